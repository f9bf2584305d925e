# Spack: copy into <repository>/packages/py_hexcontact/, or `spack create --template python`.
import os

from spack_repo.builtin.build_systems.python import PythonPackage

from spack.package import *


class PyHexcontact(PythonPackage):
    """Semi-analytical solver for 3-D contact of elastic half-spaces."""

    license("BSD-3-Clause")

    # the source archive of `make package`, in the folder where spack is called
    url = f"file://{os.getcwd()}/hexcontact-0.5.0.tar.gz"
    manual_download = True
    version("0.5.0")

    variant("pocketfft", default=False, description="Transforms by pocketfft in place of FFTW")

    depends_on("c", type="build")
    depends_on("cxx", type="build", when="+pocketfft")
    depends_on("fortran", type="build")
    depends_on("pkgconfig", type="build")
    depends_on("openblas")
    depends_on("fftw@3 precision=float,double", when="~pocketfft")

    depends_on("python@3.11:", type=("build", "run"))
    depends_on("py-meson-python@0.17:", type="build")
    depends_on("meson@1.3:", type="build")
    depends_on("py-numpy@2.0:", type="build")

    with default_args(type="run"):
        depends_on("py-numpy@1.24:")
        depends_on("py-scipy@1.10:")
        depends_on("py-netcdf4@1.6.5:")
        depends_on("py-xarray@2023.12:")
        depends_on("py-pandas@2.1:")
        depends_on("py-pydantic@2.9:")
        depends_on("py-pint@0.24.4:")
        depends_on("py-typer@0.16:")
        depends_on("py-rich@13.7:")
        depends_on("py-matplotlib@3.8:")
        depends_on("py-jinja2@3.1:")
        depends_on("py-pillow@10:")
        depends_on("py-psutil@5.9:")
        depends_on("py-tomli-w@1.0:")

    def config_settings(self, spec, prefix):
        return {"setup-args": "-Dfft=pocketfft"} if spec.satisfies("+pocketfft") else {}
