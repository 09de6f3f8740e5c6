"""Names that have moved, until all that imports them has followed."""

from ..build import UNPREFIXED as UNPREFIXED
from ..build import Plan as Plan
from ..build import build_native as build_native
from ..build import compiler_for as compiler_for
from ..build import job as job
from ..build import planned as planned
from ..build import with_binaries as with_binaries
