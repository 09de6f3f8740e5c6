"""Systems whose FMUs all run in processes of their own, or all in this one."""

from grasp_cosim import System


def isolated(system: System, isolation: str = "process") -> System:
    """A copy with all components in processes of their own, or with "none" in this one."""
    return system.with_settings(
        {f"components.{c.name}.isolation": isolation for c in system.components}
    )
