"""The variables of the gripper plant as its proxy exchanges them."""

from grasp_cosim.fmu_export.contract import declared
from grasp_cosim.fmu_export.contract import variables as variables_of
from grasp_cosim.fmu_export.proxy import shared_signature
from gripper_plant import rigid

_LISTED = variables_of(declared(rigid))
SIGNATURE = shared_signature(_LISTED)
START = {v.name: v.start for v in _LISTED if v.start is not None}
