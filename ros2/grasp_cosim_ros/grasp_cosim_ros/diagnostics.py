"""The state of an exchange as a status of /diagnostics."""

from __future__ import annotations

from dataclasses import fields

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from .exchange import Exchange, Phase


def status(name: str, exchange: Exchange | None, reason: str) -> DiagnosticStatus:
    """The status: OK while all samples come, a warning while some are missed, an error when lost.

    Args:
        name: The name of the node.
        exchange: The exchange, None where the node is not active.
        reason: Why the last exchange ended or the peers were lost; empty if nothing was.
    """
    answer = DiagnosticStatus(name=name, hardware_id="grasp_cosim")
    if exchange is None:
        answer.level = DiagnosticStatus.ERROR if reason else DiagnosticStatus.OK
        answer.message = reason or "not active"
        return answer
    count = exchange.samples.count
    answer.message = exchange.phase.value
    answer.level = DiagnosticStatus.OK
    if exchange.phase is Phase.LOST:
        answer.level, answer.message = DiagnosticStatus.ERROR, f"{exchange.phase.value}: {reason}"
    elif exchange.phase is Phase.WAITING:
        answer.level = DiagnosticStatus.WARN
        answer.message = f"{exchange.phase.value}: {reason}" if reason else exchange.phase.value
    elif count.misses_in_row:
        answer.level = DiagnosticStatus.WARN
    answer.values = [
        KeyValue(key="time", value=f"{1e-9 * float(exchange.model.time_ns):.9g} s"),
        *(
            KeyValue(key=f.name.replace("_", " "), value=str(getattr(count, f.name)))
            for f in fields(count)
        ),
    ]
    return answer
