"""NetCDF: version 4 is HDF5, the classic one is read by SciPy."""

from os import PathLike, fspath

import numpy as np

from fracjax._io._arrays import Array, array_table
from fracjax._io._files import opened, reading
from fracjax._io._hdf5 import read_hdf5
from fracjax._io._table import Table

_KIND = "a NetCDF file"


def read_netcdf(path: str | PathLike[str]) -> Table:
    """The variables of a NetCDF file, with what their attributes say.

    Raises InputError for a file that is no whole NetCDF file.
    """
    source = fspath(path)
    with opened(source), open(source, "rb") as file:
        if file.read(4) == b"\x89HDF":
            return read_hdf5(source)
    arrays: dict[str, Array] = {}
    facts: dict[str, object] = {}
    with reading(source, _KIND):
        from scipy.io import netcdf_file

        with netcdf_file(source, "r", mmap=False) as content:
            facts |= dict(content._attributes)
            for name, variable in content.variables.items():
                values = np.array(variable.data).astype(variable.data.dtype.newbyteorder("="))
                facts |= {
                    f"{name}/{key}": attribute for key, attribute in variable._attributes.items()
                }
                if values.size == 1:
                    facts[name] = values
                else:
                    arrays[name] = Array(values.shape, values.dtype, values.view)
    return array_table(source, arrays, facts)
