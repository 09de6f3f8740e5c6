"""The FMUs have the variables that other tools rely on."""

from dataclasses import replace

import pytest
from grasp_cosim.interface.read import read_interface
from support.kinds import all_kinds

PLANT = """
force[1]                      input      Real     N      0.0
force[2]                      input      Real     N      0.0
position[1]                   output     Real     m
position[2]                   output     Real     m
velocity[1]                   output     Real     m/s
velocity[2]                   output     Real     m/s
gap[1]                        output     Real     m
gap[2]                        output     Real     m
contact_force[1]              output     Real     N
contact_force[2]              output     Real     N
contact[1]                    output     Boolean  -
contact[2]                    output     Boolean  -
object_position               output     Real     m
finger_mass[1]                parameter  Real     kg     0.5
finger_mass[2]                parameter  Real     kg     0.5
initial_position[1]           parameter  Real     m      0.11
initial_position[2]           parameter  Real     m      -0.11
object_width                  parameter  Real     m      0.07
initial_object_position       parameter  Real     m      0.03
"""
FRICTION = """
friction.coulomb[1]           parameter  Real     N      0.0
friction.coulomb[2]           parameter  Real     N      0.0
friction.static[1]            parameter  Real     N      0.0
friction.static[2]            parameter  Real     N      0.0
friction.viscous[1]           parameter  Real     N.s/m  0.0
friction.viscous[2]           parameter  Real     N.s/m  0.0
friction.stribeck_velocity    parameter  Real     m/s    0.01
actuator.force_limit[1]       parameter  Real     N      0.0
actuator.force_limit[2]       parameter  Real     N      0.0
"""
SENSOR = """
gap                           input      Real     m      0.1
intensity                     output     Real     V
reflectance                   parameter  Real     1      1.0
gain                          parameter  Real     V.m^n  0.0024
diffusion_exponent            parameter  Real     1      1.1506
offset_distance               parameter  Real     m      0.005
pattern.enabled               parameter  Boolean  -      false
pattern.ratio                 parameter  Real     1      0.57
pattern.period                parameter  Real     m      0.02
pattern.phase                 parameter  Real     m      0.0
pattern.edge                  parameter  Real     m      0.002
ambient.enabled               parameter  Boolean  -      false
ambient.offset                parameter  Real     V      0.35
ambient.calibration_error     parameter  Real     V      0.0
ambient.drift                 parameter  Real     V/s    0.0
noise.enabled                 parameter  Boolean  -      false
noise.standard_deviation      parameter  Real     V      0.005
noise.seed                    parameter  Integer  -      1
adc.enabled                   parameter  Boolean  -      false
adc.bits                      parameter  Integer  -      16
adc.range[1]                  parameter  Real     V      -10.0
adc.range[2]                  parameter  Real     V      10.0
filter.enabled                parameter  Boolean  -      false
filter.cutoff                 parameter  Real     Hz     500.0
median.enabled                parameter  Boolean  -      false
sampling.rate                 parameter  Real     Hz     10000.0
surface                       parameter  Integer  -      0
"""
CONTROLLER = """
position[1]                   input      Real     m      0.11
position[2]                   input      Real     m      -0.11
velocity[1]                   input      Real     m/s    0.0
velocity[2]                   input      Real     m/s    0.0
intensity[1]                  input      Real     V      0.03
intensity[2]                  input      Real     V      0.03
force[1]                      output     Real     N
force[2]                      output     Real     N
target_position               output     Real     m
virtual_position[1]           output     Real     m
virtual_position[2]           output     Real     m
simultaneous_contact_force    output     Real     N
impact_reduction_force[1]     output     Real     N
impact_reduction_force[2]     output     Real     N
simultaneous_contact.enabled  parameter  Boolean  -      true
simultaneous_contact.mass     parameter  Real     kg     1.0
simultaneous_contact.damping  parameter  Real     N.s/m  12.0
simultaneous_contact.stiffness  parameter  Real   N/m    36.0
simultaneous_contact.gain     parameter  Real     N      3.0
impact_reduction.enabled      parameter  Boolean  -      true
impact_reduction.mass         parameter  Real     kg     1.0
impact_reduction.damping      parameter  Real     N.s/m  10.0
impact_reduction.stiffness    parameter  Real     N/m    25.0
impact_reduction.viscosity[1]  parameter  Real    N.s    0.6
impact_reduction.viscosity[2]  parameter  Real    N.s    -0.6
contact_force.damping         parameter  Real     N.s/m  14.0
contact_force.stiffness       parameter  Real     N/m    98.0
"""
COMPLIANT = """
squeeze                       output     Real     m
damaged                       output     Boolean  -
squeeze_limit                 parameter  Real     m      0.01
"""
MOVABLE = """
tilt                          output     Real     rad
toppled                       output     Boolean  -
object_mass                   parameter  Real     kg     0.05
object_height                 parameter  Real     m      0.1
contact_height                parameter  Real     m      0.05
floor_friction                parameter  Real     1      0.3
"""
ADAPTIVE = """
reflectance_ratio             output     Real     1
reflectance_ratio_standard_deviation  output  Real  1
estimated_gap[1]              output     Real     m
estimated_gap[2]              output     Real     m
hold                          output     Real     1
reflectance.diffusion_exponent  parameter  Real   1      1.1506
reflectance.time_constant     parameter  Real     s      0.02
reflectance.weight_exponent   parameter  Real     1      5.0
reflectance.intensity_noise   parameter  Real     V      0.00025
reflectance.prior_deviation   parameter  Real     1      1.0
reflectance.limit             parameter  Real     1      2.5
reflectance.gain              parameter  Real     V.m^n  0.0024
reflectance.offset_distance   parameter  Real     m      0.005
hold.squeeze                  parameter  Real     N      0.1
hold.speed                    parameter  Real     m/s    0.002
hold.time_constant            parameter  Real     s      0.02
"""
FMUS = {
    "GripperPlant": PLANT + FRICTION,
    "GripperPlantCompliant": PLANT + FRICTION + COMPLIANT,
    "GripperPlantMovable": PLANT + FRICTION + MOVABLE,
    "ProximitySensor": SENSOR,
    "GraspController": CONTROLLER,
    "GraspControllerAdaptive": CONTROLLER + ADAPTIVE,
}

EXTRA = ("baumgarte_", "impact_reduction.intensity_floor", "kelvin_voigt.", "hunt_crossley.")
"""How those begin that are not agreed."""


def described(v):
    row = (v.name, v.causality, v.kind, v.unit or "-")
    return row if v.start is None else (*row, v.start)


@all_kinds
@pytest.mark.parametrize(("name", "table"), FMUS.items())
def test_variables_are_those_agreed(folder_of, kind, name, table):
    agreed = {tuple(line.split()) for line in table.splitlines() if line}
    found = read_interface(folder_of(kind) / f"{name}.fmu").variables
    ours = {described(v) for v in found if v.causality != "independent"}
    assert agreed <= ours
    assert all(row[0].startswith(EXTRA) for row in ours - agreed)


def test_the_adaptive_controller_takes_the_place_of_the_published_one(fmus):
    """Every variable of that, declared alike and in the same order; what it adds is its own."""
    published, adaptive = (
        read_interface(fmus / f"{name}.fmu")
        for name in ("GraspController", "GraspControllerAdaptive")
    )
    alike = [
        replace(theirs, reference=ours.reference, initial_dependencies=ours.initial_dependencies)
        for ours, theirs in zip(
            published.variables,
            [v for v in adaptive.variables if v.name in published.by_name],
            strict=True,
        )
    ]
    assert alike == [*published.variables]
    added = [v for v in adaptive.variables if v.name not in published.by_name]
    assert {v.causality for v in added} == {"output", "parameter"}
    assert all(v.dependencies == () for v in added if v.causality == "output")
