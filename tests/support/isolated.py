"""Systems whose FMUs all run in processes of their own, or all in this one."""


def isolated(system, isolation="process"):
    """A copy with all components in processes of their own, or with "none" in this one."""
    return system.with_settings(
        {f"components.{c.name}.isolation": isolation for c in system.components}
    )
