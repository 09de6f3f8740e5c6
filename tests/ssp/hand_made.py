"""SSP archives as others make them, by hand, with FMUs that have an interface and no code."""

import zipfile

NAMESPACES = " ".join(
    f'xmlns:{prefix}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for prefix, name in (
        ("ssc", "Common"),
        ("ssd", "Description"),
        ("ssv", "ParameterValues"),
        ("ssm", "ParameterMapping"),
    )
)

UNITS = """
  <ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit>
  <ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>
  <ssc:Unit name="N"><ssc:BaseUnit kg="1" m="1" s="-2"/></ssc:Unit>
  <ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit>
  <ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit>
"""


def fmu(*variables, step="0.001"):
    """The modelDescription.xml of an FMU with variables like 'input Real u 0.0 m'.

    These are causality, type, name, start or -, unit if any. It declares the units above, and
    Mode, an enumeration of off = 1 and on = 2.
    """
    fields = [variable.split() for variable in variables]
    outputs = [i for i, field in enumerate(fields, 1) if field[0] == "output"]
    known = "".join(f'<Unknown index="{i}"/>' for i in outputs)
    experiment = f'<DefaultExperiment stepSize="{step}"/>' if step else ""
    structure = (
        f"<Outputs>{known}</Outputs><InitialUnknowns>{known}</InitialUnknowns>" if outputs else ""
    )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="hand" guid="{{0}}">
  <CoSimulation modelIdentifier="hand"/>
  <UnitDefinitions>{UNITS.replace("ssc:", "")}</UnitDefinitions>
  <TypeDefinitions><SimpleType name="Mode"><Enumeration>
    <Item name="off" value="1"/><Item name="on" value="2"/>
  </Enumeration></SimpleType></TypeDefinitions>
  {experiment}
  <ModelVariables>{"".join(_variable(i, *field) for i, field in enumerate(fields))}</ModelVariables>
  <ModelStructure>{structure}</ModelStructure>
</fmiModelDescription>""".encode()


def _variable(index, causality, kind, name, start="-", unit=""):
    variability = {
        "parameter": "fixed",
        "calculatedParameter": "fixed",
    }.get(causality, "continuous" if kind == "Real" else "discrete")
    declared = ' declaredType="Mode"' if kind == "Enumeration" else ""
    declared += f' unit="{unit}"' if unit else ""
    declared += f' start="{start}"' if start != "-" else ""
    return (
        f'<ScalarVariable name="{name}" valueReference="{index}" causality="{causality}" '
        f'variability="{variability}"><{kind}{declared}/></ScalarVariable>'
    )


def component(name, connectors="", bindings="", **attributes):
    """An element Component whose FMU is resources/NAME.fmu; connectors like 'input u Real'."""
    given = {"source": f"resources/{name}.fmu", **attributes}
    listed = " ".join(f'{key}="{value}"' for key, value in given.items())
    return (
        f'<ssd:Component name="{name}" {listed}>{connector_list(connectors)}'
        f"{binding_list(bindings)}</ssd:Component>"
    )


def system(name, elements, connections="", connectors="", bindings=""):
    """An element System."""
    connected = f"<ssd:Connections>{connections}</ssd:Connections>" if connections else ""
    return (
        f'<ssd:System name="{name}">{connector_list(connectors)}{binding_list(bindings)}'
        f"<ssd:Elements>{elements}</ssd:Elements>{connected}</ssd:System>"
    )


def connector_list(text):
    """Connectors from 'kind name [type [unit]]; ...'."""
    if not text:
        return ""
    return f"<ssd:Connectors>{''.join(map(_connector, text.split(';')))}</ssd:Connectors>"


def _connector(text):
    kind, name, *more = text.split()
    unit = f' unit="{more[1]}"' if len(more) > 1 else ""
    content = f"<ssc:{more[0]}{unit}/>" if more else ""
    return f'<ssd:Connector name="{name}" kind="{kind}">{content}</ssd:Connector>'


def binding_list(bindings):
    """The element ParameterBindings around the bindings."""
    return f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings>" if bindings else ""


def connect(start, end, content="", **attributes):
    """A connection between 'element/connector' or 'connector' of the system itself."""
    ends = []
    for side, text in (("start", start), ("end", end)):
        element, slash, name = text.rpartition("/")
        ends.append(f'{side}Element="{element}" ' if slash else "")
        ends.append(f'{side}Connector="{name}" ')
    more = " ".join(f'{key}="{value}"' for key, value in attributes.items())
    return f"<ssd:Connection {''.join(ends)}{more}>{content}</ssd:Connection>"


def linear(factor=1.0, offset=0.0):
    """A linear transformation."""
    return f'<ssc:LinearTransformation factor="{factor}" offset="{offset}"/>'


def parameter_set(parameters, units=UNITS):
    """A ParameterSet from 'name Type value [unit]; ...'."""
    listed = "".join(map(_parameter, filter(None, parameters.split(";"))))
    known = f"<ssv:Units>{units}</ssv:Units>" if units else ""
    return (
        f'<ssv:ParameterSet version="1.0" name="set" {NAMESPACES}><ssv:Parameters>{listed}'
        f"</ssv:Parameters>{known}</ssv:ParameterSet>"
    )


def _parameter(text):
    name, kind, value, *unit = text.split()
    more = f' unit="{unit[0]}"' if unit else ""
    return f'<ssv:Parameter name="{name}"><ssv:{kind} value="{value}"{more}/></ssv:Parameter>'


def mapping(*entries, suppress=False):
    """A ParameterMapping of (source, target, transformation)."""
    more = ' suppressUnitConversion="true"' if suppress else ""
    listed = "".join(
        f'<ssm:MappingEntry source="{source}" target="{target}"{more}>{content}</ssm:MappingEntry>'
        for source, target, content in entries
    )
    return f'<ssm:ParameterMapping version="1.0" {NAMESPACES}>{listed}</ssm:ParameterMapping>'


def bind(inline, mapped="", **attributes):
    """A binding with its parameter set and mapping inline."""
    more = " ".join(f'{key}="{value}"' for key, value in attributes.items())
    content = f"<ssd:ParameterMapping>{mapped}</ssd:ParameterMapping>" if mapped else ""
    return (
        f"<ssd:ParameterBinding {more}><ssd:ParameterValues>{inline}</ssd:ParameterValues>"
        f"{content}</ssd:ParameterBinding>"
    )


def annotated(kind, content):
    """Annotations with one of that type."""
    annotation = f'<ssc:Annotation type="{kind}">{content}</ssc:Annotation>'
    return f"<ssd:Annotations>{annotation}</ssd:Annotations>"


def structure(
    top,
    experiment='<ssd:DefaultExperiment startTime="0" stopTime="1"/>',
    annotations="",
    version="1.0",
):
    """An SSD around the top system."""
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<ssd:SystemStructureDescription name="hand" version="{version}" {NAMESPACES}>{top}'
        f"<ssd:Units>{UNITS}</ssd:Units>{experiment}{annotations}"
        f"</ssd:SystemStructureDescription>"
    )


def archive(folder, ssd, fmus, files=None):
    """The archive hand.ssp in a folder: its SSD, FMUs by name, further files by entry."""
    entries = {"SystemStructure.ssd": ssd}
    for name, description in fmus.items():
        inner = described(folder / "inner.zip", description)
        entries[f"resources/{name}.fmu"] = inner.read_bytes()
    return zipped(folder / "hand.ssp", {**entries, **(files or {})})


def changed(path, edit):
    """Rewrite an archive with its SystemStructure.ssd edited."""
    entries = entries_of(path)
    zipped(path, entries | {"SystemStructure.ssd": edit(entries["SystemStructure.ssd"])})


def described(path, description, **files):
    """An FMU that is a description, and further files."""
    return zipped(path, {"modelDescription.xml": description, **files})


def zipped(path, entries):
    """A zip file of entries by name, the same at any time."""
    with zipfile.ZipFile(path, "w") as file:
        for name, content in entries.items():
            file.writestr(zipfile.ZipInfo(name), content)
    return path


def entries_of(path):
    """The contents of a zip file by name."""
    with zipfile.ZipFile(path) as file:
        return {name: file.read(name) for name in file.namelist()}
