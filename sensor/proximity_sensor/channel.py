"""One channel of the sensor: the optics, then the electronics, each stage of which can be off.

    optics (Eq. 9, spot) -> + ambient offset -> + noise -> ADC -> low-pass -> median -> - offset

When it samples, and which gap it sees then: sensor/README.md.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, NamedTuple

from block_variables import Parameter

from . import electronics, optics
from . import noise as random_noise
from . import spot as finite_spot
from .optics import check_inputs as check_inputs
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

    spot: finite_spot.Spot = finite_spot.Spot()
    face: finite_spot.Face = finite_spot.Face()
    pattern: finite_spot.Pattern = finite_spot.Pattern()
    ambient: electronics.Ambient = electronics.Ambient()
    noise: random_noise.Noise = random_noise.Noise()
    adc: electronics.Adc = electronics.Adc()
    filter: electronics.Filter = electronics.Filter()
    median: electronics.Median = electronics.Median()
    sampling: electronics.Sampling = electronics.Sampling()
    surface: Annotated[
        optics.Surface,
        Parameter("a surface by name wins over reflectance; custom leaves it", tunable=True),
    ] = optics.Surface.CUSTOM

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
        return optics.REFLECTANCE.get(self.surface, self.reflectance)

    @cached_property
    def sampled(self) -> bool:
        """True if a stage of the electronics is on."""
        stages = (self.ambient, self.noise, self.adc, self.filter, self.median)
        return any(stage.enabled for stage in stages)

    @cached_property
    def plain(self) -> bool:
        """True if there is nothing but Eq. (9)."""
        return not (self.sampled or self.spot.enabled)

    @cached_property
    def coefficients(self) -> electronics.Coefficients:
        """Those of the filter."""
        return electronics.coefficients(self.filter.cutoff, self.sampling.rate)


class Chain(NamedTuple):
    """Memory of the electronics, from sample to sample."""

    number: float
    """That of the next sample, counted from the start."""
    generator: random_noise.State
    deviation: float
    """The noise of the next sample, in standard deviations."""
    memory: electronics.Memory
    window: electronics.Window


class State(NamedTuple):
    """Of no meaning while no stage of the electronics is on."""

    wait: float
    """Periods of the sampling rate to the next sample."""
    chain: Chain


SILENT = Chain(0.0, (0.0,) * 6, 0.0, (0.0,) * 5, (0.0,) * 10)


def initial_state(p: Params, u: Inputs) -> State:
    """As after the first gap for a long time: filter and median have settled, on noise too."""
    return State(0.0, _settled(p, _light(p, u)) if p.sampled else SILENT)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Take the samples within h seconds (h > 0), the gap held."""
    if not p.sampled:
        return x
    n, wait = electronics.samples(p.sampling, x.wait, h)
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
    if electronics.due(x.wait):
        _, window = _measured(p, x.chain, light)
    volts = electronics.median(window) if p.median.enabled else window[-1]
    return Outputs(volts - p.ambient.offset if p.ambient.enabled else volts)


def _light(p: Params, u: Inputs) -> float:
    """The intensity xi in V, of the whole spot if it is one."""
    xi = seen(p, u).intensity
    if not p.spot.enabled or u.gap > optics.FARTHEST:
        return xi
    z_0 = (0.0 if u.gap < 0.0 else u.gap) + p.offset_distance
    return xi * finite_spot.brightness(p.spot, p.face, p.pattern, p.diffusion_exponent, z_0)


def _measured(p: Params, c: Chain, light: float) -> tuple[electronics.Memory, electronics.Window]:
    """What the filter and the median hold after a sample of xi = light."""
    volts, memory = light, c.memory
    if p.ambient.enabled:
        volts += electronics.ambient_voltage(p.ambient, c.number / p.sampling.rate)
    if p.noise.enabled:
        volts += p.noise.standard_deviation * c.deviation
    if p.adc.enabled:
        volts = electronics.converted(p.adc, volts)
    if p.filter.enabled:
        volts, memory = electronics.filtered(p.coefficients, memory, volts)
    return memory, (*c.window[1:], volts)


def _sampled(p: Params, c: Chain, light: float) -> Chain:
    """After a sample of xi = light, and with the noise of the next one."""
    memory, window = _measured(p, c, light)
    deviation, generator = c.deviation, c.generator
    if p.noise.enabled:
        deviation, generator = random_noise.normal(generator)
    return Chain(c.number + 1.0, generator, deviation, memory, window)


def _settled(p: Params, light: float) -> Chain:
    """After xi = light for ever, and the noise of WARM_UP samples."""
    volts = light + electronics.ambient_voltage(p.ambient, 0.0) if p.ambient.enabled else light
    if p.adc.enabled:
        volts = electronics.converted(p.adc, volts)
    memory = electronics.settled(p.coefficients, volts) if p.filter.enabled else SILENT.memory
    chain = SILENT._replace(memory=memory, window=(volts,) * 10)
    if not p.noise.enabled:
        return chain
    deviation, generator = random_noise.normal(random_noise.stream(float(p.noise.seed)))
    chain = chain._replace(number=-float(WARM_UP), generator=generator, deviation=deviation)
    for _ in range(WARM_UP):
        chain = _sampled(p, chain, light)
    return chain
