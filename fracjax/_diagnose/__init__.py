"""Diagnosis: where model and recording differ, and what physics was left out."""

from ._diagnose import diagnose as diagnose
from ._extension import ANY_LOOP as ANY_LOOP
from ._result import Axis as Axis
from ._result import Candidate as Candidate
from ._result import Diagnosis as Diagnosis
from ._result import HeldOut as HeldOut
from ._result import NamedEffect as NamedEffect
from ._result import NextExperiment as NextExperiment
from ._result import Shape as Shape
from ._shape import entry_of as entry_of
