"""Real time: the inverse and the model sample by sample, in Python and in C from one description."""

from ._adaptive import Adaptation as Adaptation
from ._program import FLAGS as FLAGS
from ._stepping import Streamed as Streamed
from ._stepping import StreamingInverse as StreamingInverse
from ._stepping import StreamingModel as StreamingModel
from ._stepping import streaming_inverse as streaming_inverse
from ._stepping import streaming_model as streaming_model
