"""Real time: inverse and model sample by sample, in Python and in C from one description."""

from ._adaptive import Adaptation as Adaptation
from ._c import platforms as platforms
from ._program import FLAGS as FLAGS
from ._promise import Promise as Promise
from ._promise import Promised as Promised
from ._promise import draws_of as draws_of
from ._stepping import streaming_inverse as streaming_inverse
from ._stepping import streaming_model as streaming_model
from ._stepping import usual_band as usual_band
from ._stream import Streamed as Streamed
from ._stream import StreamingInverse as StreamingInverse
from ._stream import StreamingModel as StreamingModel
