"""One channel of the sensor: the optics, then the electronics, each stage of which can be off.

    optics (Eq. 9, stripes) -> + ambient offset -> + noise -> ADC -> low-pass -> median -> - offset

When it samples, and which gap it sees then: sensor/README.md.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, NamedTuple

from block_variables import Parameter

from . import (
    ambient_light,
    clock,
    converter,
    gaussian_noise,
    low_pass,
    mrg32k3a,
    optics,
    sliding_median,
    stripes,
    surfaces,
)
from .optics import outputs as seen

Inputs = optics.Inputs
Outputs = optics.Outputs

LONGEST_STEP = 2.0
"""s; a longer communication step is discarded."""

WARM_UP = 100
"""Samples of noise that are in filter and median at the start."""


@dataclass(frozen=True)  # no slots: what is worked out from the parameters is kept
class Params(optics.Params):
    """The parameters of the optics and of the stages."""

    pattern: stripes.Params = stripes.Params()
    ambient: ambient_light.Params = ambient_light.Params()
    noise: gaussian_noise.Params = gaussian_noise.Params()
    adc: converter.Params = converter.Params()
    filter: low_pass.Params = low_pass.Params()
    median: sliding_median.Params = sliding_median.Params()
    sampling: clock.Params = clock.Params()
    surface: Annotated[
        surfaces.Surface,
        Parameter("a surface by name wins over reflectance; custom leaves it", tunable=True),
    ] = surfaces.Surface.CUSTOM

    def __post_init__(self) -> None:
        optics.Params.__post_init__(self)
        highest = 0.5 * self.sampling.rate
        if self.filter.enabled and not self.filter.cutoff < highest:
            raise ValueError(
                f"filter.cutoff = {self.filter.cutoff!r} Hz: must be below half of sampling.rate, "
                f"{highest:g}"
            )

    @cached_property
    def alpha(self) -> float:
        """The reflectance of the surface named, or the one given."""
        return surfaces.REFLECTANCE.get(self.surface, self.reflectance)

    @cached_property
    def sampled(self) -> bool:
        """True if a stage of the electronics is on."""
        stages = (self.ambient, self.noise, self.adc, self.filter, self.median)
        return any(stage.enabled for stage in stages)

    @cached_property
    def plain(self) -> bool:
        """True if there is nothing but Eq. (9)."""
        return not (self.sampled or self.pattern.enabled)

    @cached_property
    def coefficients(self) -> low_pass.Coefficients:
        """Those of the filter."""
        return low_pass.coefficients(self.filter.cutoff, self.sampling.rate)


class Chain(NamedTuple):
    """Memory of the electronics, from sample to sample."""

    number: float
    """That of the next sample, counted from the start."""
    generator: mrg32k3a.State
    deviation: float
    """The noise of the next sample, in standard deviations."""
    memory: low_pass.Memory
    window: sliding_median.Window


class State(NamedTuple):
    """Of no meaning while no stage of the electronics is on."""

    wait: float
    """Periods of the sampling rate to the next sample."""
    chain: Chain


SILENT = Chain(0.0, (0.0,) * 6, 0.0, (0.0,) * 5, (0.0,) * 10)


def initial_state(p: Params, u: Inputs) -> State:
    """As after the first gap for a long time: filter and median have settled, on noise as well."""
    return State(0.0, _settled(p, _light(p, u)) if p.sampled else SILENT)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Take the samples within h seconds (h > 0), the gap held."""
    if not p.sampled:
        return x
    n, wait = clock.samples(p.sampling, x.wait, h)
    chain = x.chain
    if n:
        light = _light(p, u)
        for _ in range(n):
            chain = _sampled(p, chain, light)
    return State(wait, chain)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """Of the sample that is due now, which sees the gap u, or else of the last one."""
    if p.plain:
        return seen(p, u)
    light = _light(p, u)
    if not p.sampled:
        return Outputs(light)
    window = x.chain.window
    if clock.due(x.wait):
        _, window = _measured(p, x.chain, light)
    volts = sliding_median.median(window) if p.median.enabled else window[-1]
    return Outputs(volts - p.ambient.offset if p.ambient.enabled else volts)


def _light(p: Params, u: Inputs) -> float:
    """The intensity xi in V, of a striped surface if it is one."""
    xi = seen(p, u).intensity
    if not p.pattern.enabled:
        return xi
    return xi * stripes.factor(p.pattern, 0.0 if u.gap < 0.0 else u.gap)


def _measured(p: Params, c: Chain, light: float) -> tuple[low_pass.Memory, sliding_median.Window]:
    """What the filter and the median hold after a sample of xi = light."""
    volts, memory = light, c.memory
    if p.ambient.enabled:
        volts += ambient_light.voltage(p.ambient, c.number / p.sampling.rate)
    if p.noise.enabled:
        volts += p.noise.standard_deviation * c.deviation
    if p.adc.enabled:
        volts = converter.converted(p.adc, volts)
    if p.filter.enabled:
        volts, memory = low_pass.filtered(p.coefficients, memory, volts)
    return memory, (*c.window[1:], volts)


def _sampled(p: Params, c: Chain, light: float) -> Chain:
    """After a sample of xi = light, and with the noise of the next one."""
    memory, window = _measured(p, c, light)
    deviation, generator = c.deviation, c.generator
    if p.noise.enabled:
        deviation, generator = gaussian_noise.normal(generator)
    return Chain(c.number + 1.0, generator, deviation, memory, window)


def _settled(p: Params, light: float) -> Chain:
    """After xi = light for ever, and the noise of WARM_UP samples."""
    volts = light + ambient_light.voltage(p.ambient, 0.0) if p.ambient.enabled else light
    if p.adc.enabled:
        volts = converter.converted(p.adc, volts)
    memory = low_pass.settled(p.coefficients, volts) if p.filter.enabled else SILENT.memory
    chain = SILENT._replace(memory=memory, window=(volts,) * 10)
    if not p.noise.enabled:
        return chain
    deviation, generator = gaussian_noise.normal(mrg32k3a.stream(float(p.noise.seed)))
    chain = chain._replace(number=-float(WARM_UP), generator=generator, deviation=deviation)
    for _ in range(WARM_UP):
        chain = _sampled(p, chain, light)
    return chain
