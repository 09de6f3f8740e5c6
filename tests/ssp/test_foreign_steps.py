"""The step in annotations of OSP and OMSimulator: read from theirs, written for them."""

import zipfile
from dataclasses import replace

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.ssp.to_archive import write_ssp
from lxml import etree  # type: ignore[import-untyped]
from ssp.hand_made import NAMESPACES, archive, changed, component, connect, fmu, structure, system

OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
NAMES = {"osp": OSP, "oms": OMS}

GIVES, TAKES = fmu("output Real y -", step="0.01"), fmu("input Real u 0.0")


def annotation(kind, content):
    return (
        f'<ssd:Annotations><ssc:Annotation type="{kind}">{content}</ssc:Annotation>'
        "</ssd:Annotations>"
    )


def osp(step):
    inner = f'<osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="{step}"/></osp:Algorithm>'
    return annotation("com.opensimulationplatform", inner)


def oms(step, around="oms:Annotations"):
    """Early archives have no element oms:Annotations in the annotation."""
    inner = f'<oms:FixedStepMaster description="oms-ma" stepSize="{step}"/>'
    inner = f"<oms:SimulationInformation>{inner}</oms:SimulationInformation>"
    return annotation("org.openmodelica", f"<{around}>{inner}</{around}>" if around else inner)


def load(folder, experiment="", top="", hint="", step=None):
    parts = component("a", "output y") + component("b", "input u").replace(
        "</ssd:Component>", f"{hint}</ssd:Component>"
    )
    whole = system("top", parts, connect("a/y", "b/u"))
    whole = whole.removesuffix("</ssd:System>") + f"{top}</ssd:System>"
    ssd = structure(
        whole, f'<ssd:DefaultExperiment stopTime="1">{experiment}</ssd:DefaultExperiment>'
    )
    ssd = ssd.replace(NAMESPACES, f'{NAMESPACES} xmlns:osp="{OSP}" xmlns:oms="{OMS}"', 1)
    return System.load(archive(folder, ssd, {"a": GIVES, "b": TAKES}), step=step)


@pytest.mark.parametrize("around", ["oms:Annotations", ""])
def test_the_step_of_omsimulator(tmp_path, around):
    loaded = load(tmp_path, top=oms("0.002000", around))
    assert (loaded.step_ns, loaded.scheme) == (2_000_000, "jacobi")
    place = "hand.ssp: SystemStructure.ssd:2: annotation 'org.openmodelica'"
    assert f"step = 0.002 s, by {place}" in loaded.notes
    assert f"scheme = jacobi, as meant by {place}" in loaded.notes


def test_the_step_of_osp(tmp_path):
    loaded = load(tmp_path, osp("5e-3"))
    assert (loaded.step_ns, loaded.scheme) == (5_000_000, "jacobi")
    assert not any("not used" in note for note in loaded.notes)


def test_the_namespace_does_not_matter(tmp_path):
    """Tools and versions of them have several."""
    other = osp("0.005").replace("<osp:Algorithm>", '<osp:Algorithm xmlns:osp="urn:other">')
    assert load(tmp_path, other).step_ns == 5_000_000
    plain = oms("0.002", "").replace("oms:", "")
    assert load(tmp_path, top=plain).step_ns == 2_000_000


def test_a_given_step_goes_before(tmp_path):
    assert load(tmp_path, osp("0.005"), oms("0.002"), step=0.001).step_ns == 1_000_000


def test_two_tools_may_name_the_same_step(tmp_path):
    assert load(tmp_path, osp("0.002"), oms("0.002000")).step_ns == 2_000_000


def test_a_component_with_a_hint_has_a_step_of_its_own(tmp_path):
    """OSP takes the multiple of the base step that is nearest."""
    hint = annotation("com.opensimulationplatform", '<osp:StepSizeHint value="0.021"/>')
    loaded = load(tmp_path, osp("0.01"), hint=hint)
    assert {c.name: c.step_ns for c in loaded.components} == {"a": None, "b": 20_000_000}


@pytest.mark.parametrize(
    ("experiment", "top", "message"),
    [
        (osp("0.002"), oms("0.001"), "its annotations name several steps, 0.002 s, 0.001 s; give"),
        (osp("fast"), "", "'com.opensimulationplatform': step = 'fast': must be a number of s"),
        (osp("0"), "", "step = 0.0 s: must be a number greater than 0"),
    ],
)
def test_steps_that_are_refused(tmp_path, experiment, top, message):
    with pytest.raises(InputError, match=r"^hand\.ssp: ") as error:
        load(tmp_path, experiment, top)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_what_we_write_is_where_the_two_look_for_it(grasp, tmp_path):
    """After the sources: libcosim, ssp_parser.cpp; OMSimulator, Model.cpp and SystemWC.cpp."""
    plant, *others = grasp.with_experiment(5e-4).components
    own = replace(plant, step_ns=1_000_000)
    path = tmp_path / "grasp.ssp"
    write_ssp(replace(grasp.with_experiment(5e-4), components=(own, *others)), path)
    with zipfile.ZipFile(path) as file:
        root = etree.fromstring(file.read("SystemStructure.ssd"))
    assert (root.nsmap["osp"], root.nsmap["oms"]) == (OSP, OMS)  # declared nowhere else
    experiment = root.find("{*}DefaultExperiment/{*}Annotations")
    assert [a.get("type") for a in experiment] == ["com.opensimulationplatform", "grasp-cosim"]
    (algorithm,) = root.findall("{*}DefaultExperiment//osp:Algorithm/*", NAMES)
    assert dict(algorithm.attrib) == {"baseStepSize": "0.0005"}
    (first,) = root.find("{*}System/{*}Annotations")
    (master,) = first.findall("oms:Annotations/oms:SimulationInformation/*", NAMES)
    assert first.get("type") == "org.openmodelica"
    assert dict(master.attrib) == {
        "description": "oms-ma",
        "stepSize": "0.0005",
        "relativeTolerance": "1e-4",
    }
    (hint,) = root.findall("{*}System/{*}Elements/{*}Component//osp:StepSizeHint", NAMES)
    assert hint.get("value") == "0.001"


def test_a_step_that_varies_is_not_taken_and_said(tmp_path):
    varies = annotation("org.openmodelica", '<oms:VariableStepMaster description="oms-mav"/>')
    loaded = load(tmp_path, top=varies)
    assert (loaded.step_ns, loaded.scheme) == (1_000_000, "sequential")
    assert "annotations of type 'org.openmodelica' are not used (1)" in loaded.notes


@pytest.mark.parametrize(
    ("file", "name"), [("my-2nd grasp.toml", "my_2nd_grasp"), ("3.toml", "_3")]
)
def test_names_of_systems_are_identifiers(grasp, tmp_path, file, name):
    """Else OMSimulator refuses them."""
    write_ssp(replace(grasp, name=file), tmp_path / "a.ssp")
    with zipfile.ZipFile(tmp_path / "a.ssp") as archived:
        root = etree.fromstring(archived.read("SystemStructure.ssd"))
    assert (root.get("name"), root[0].get("name")) == (name, name)


def test_our_annotation_is_read_where_earlier_archives_have_it(grasp, tmp_path):
    path = tmp_path / "grasp.ssp"
    write_ssp(grasp, path)

    def older(ssd):
        root = etree.fromstring(ssd)
        annotations = root.find("{*}DefaultExperiment/{*}Annotations")
        annotations.remove(annotations[0])
        root.append(annotations)
        return bytes(etree.tostring(root))

    before = System.load(path)
    changed(path, older)
    after = System.load(path)
    assert after == before
    assert after.scheme == "sequential"
    assert after.notes == ()
