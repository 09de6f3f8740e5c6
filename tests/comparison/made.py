"""FMUs that are nothing but a model description, and a loop of two of them."""

import zipfile

from grasp_cosim import System

UNITS = """<UnitDefinitions>
    <Unit name="m"><BaseUnit m="1"/></Unit>
    <Unit name="metre"><BaseUnit m="1"/></Unit>
    <Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit>
    <Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit>
    <Unit name="1"><BaseUnit/></Unit>
    <Unit name="K"><BaseUnit K="1"/></Unit>
    <Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>
</UnitDefinitions>"""

PLANT = {
    "force": 'causality="input" | Real start="0" unit="N"',
    "gap": 'causality="output" | Real unit="m" nominal="0.1"',
    "touching": 'causality="output" variability="discrete" | Boolean',
    "spare": 'causality="output" | Real unit="m"',
    "width": 'causality="parameter" variability="fixed" | '
    'Real start="0.05" unit="m" min="0" max="1"',
    "mass": 'causality="parameter" variability="tunable" | Real start="0.5"',
    "name": 'causality="parameter" variability="fixed" | String start="a"',
    "inner": 'causality="local" | Real',
}
"""The variables of the plant: name to attributes and type."""

DEPENDENCIES = {"gap": (), "touching": (), "spare": ()}


def write_fmu(
    path,
    variables=PLANT,
    dependencies=DEPENDENCIES,
    capabilities='canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"',
    kind="CoSimulation",
    step="0.001",
):
    """An FMI 2.0 FMU; variables like PLANT, dependencies of the outputs (None: not declared)."""
    names = list(variables)
    scalars = []
    for i, (name, text) in enumerate(variables.items()):
        attributes, element = text.split(" | ")
        scalars.append(
            f'<ScalarVariable name="{name}" valueReference="{i}" {attributes}><{element}/>'
            "</ScalarVariable>"
        )
    unknowns = []
    for name in names:
        if 'causality="output"' in variables[name]:
            listed = dependencies.get(name)
            indices = " ".join(str(names.index(d) + 1) for d in listed or ())
            more = "" if listed is None else f' dependencies="{indices}"'
            unknowns.append(f'<Unknown index="{names.index(name) + 1}"{more}/>')
    xml = f"""<?xml version="1.0" encoding="UTF-8"?>
        <fmiModelDescription fmiVersion="2.0" modelName="Made" guid="{{1}}">
        <{kind} modelIdentifier="made" {capabilities}/>
        {UNITS}
        <DefaultExperiment stepSize="{step}"/>
        <ModelVariables>{"".join(scalars)}</ModelVariables>
        <ModelStructure><Outputs>{"".join(unknowns)}</Outputs></ModelStructure>
        </fmiModelDescription>"""
    path.parent.mkdir(exist_ok=True)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", xml)
    return path


def write_system(folder):
    """A plant and a spring that pushes it: gap -> position, force -> force, width = 0.07."""
    write_fmu(folder / "plant.fmu")
    spring = {
        "position": 'causality="input" | Real start="0" unit="m"',
        "force": 'causality="output" | Real unit="N"',
    }
    write_fmu(folder / "spring.fmu", spring, {"force": ["position"]})
    (folder / "loop.toml").write_text(
        'connections = ["plant.gap -> spring.position", "spring.force -> plant.force"]\n'
        "[experiment]\nstep = 1e-3\nstop = 0.01\n"
        '[components.plant]\nfmu = "plant.fmu"\nvalues = { width = 0.07 }\n'
        '[components.spring]\nfmu = "spring.fmu"\n'
    )
    return System.load(folder / "loop.toml")


def changed(name, before, after):
    """The plant's variables with one place in one of them changed."""
    assert PLANT[name].count(before) == 1
    return {**PLANT, name: PLANT[name].replace(before, after)}


def without(name):
    """The plant's variables but for one."""
    return {n: text for n, text in PLANT.items() if n != name}
