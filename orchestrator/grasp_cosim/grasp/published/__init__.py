"""The paper's table and figures beside ours."""
