"""Compensation: from the model to the drive that makes its response follow a trajectory."""

from ._compensate import changes_by_draws as changes_by_draws
from ._compensate import compensate as compensate
from ._inverse import without_disturbances as without_disturbances
from ._offset import settled_offset as settled_offset
from ._result import SCHEMA as SCHEMA
from ._result import Compensation as Compensation
from ._result import ModelError as ModelError
from ._result import Stretch as Stretch
from ._result import load_compensation as load_compensation
from ._trajectory import Trajectory as Trajectory
