"""The translator of before, until its last user has gone."""
