"""Compensation: from the model to the drive that makes its response follow a trajectory."""

from ._compensate import compensate as compensate
from ._result import SCHEMA as SCHEMA
from ._result import Compensation as Compensation
from ._result import Stretch as Stretch
from ._result import load_compensation as load_compensation
from ._streaming import StreamingInverse as StreamingInverse
from ._streaming import streaming_inverse as streaming_inverse
from ._trajectory import Trajectory as Trajectory
