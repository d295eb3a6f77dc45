"""A study on MPI: `mpi4py.futures.MPIPoolExecutor` computes the chunks, and the bits are those of this process."""

import importlib.util
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

import tadcore
from study_cases import CHUNK
from tadcore.sampling import Box

MPIEXEC = shutil.which("mpiexec")
pytestmark = pytest.mark.skipif(
    MPIEXEC is None or importlib.util.find_spec("mpi4py") is None, reason="MPI or mpi4py is not installed"
)
TRIALS = 2 * CHUNK + 50
PROGRAM = f"""
import sys
import numpy as np
import tadcore
from mpi4py import MPI
from mpi4py.futures import MPIPoolExecutor
from tadcore.sampling import Box

if __name__ == "__main__":
    sc = tadcore.scenarios.load("paper-i1").replace({{"horizon": 0.5, "step": 0.05}})
    study = tadcore.Study(sc, vary={{"attacker.position": Box([-3.0, -3.0], [3.0, 3.0])}}, trials={TRIALS}, seed=3)
    with MPIPoolExecutor() as executor:
        assert executor.num_workers == 1, executor.num_workers
        result = study.run(executor=executor)
    np.savez(sys.argv[1], kind=result.kind, defender=result.defender, time=result.time)
"""


def test_an_mpi_pool_computes_the_same_bits(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM, encoding="utf-8")
    command = [MPIEXEC, "-n", "2", sys.executable, "-m", "mpi4py.futures", str(program), str(tmp_path / "out.npz")]
    # Open MPI asks twice before it runs as root or on more ranks than cores, as in a container; others ignore these
    allowed = dict.fromkeys(("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"), "1")
    allowed |= {"OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_btl": "self,vader"}
    done = subprocess.run(command, env=os.environ | allowed, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    sc = tadcore.scenarios.load("paper-i1").replace({"horizon": 0.5, "step": 0.05})
    vary = {"attacker.position": Box([-3.0, -3.0], [3.0, 3.0])}
    expected = tadcore.Study(sc, vary=vary, trials=TRIALS, seed=3).run()
    with np.load(tmp_path / "out.npz") as found:
        for name in ("kind", "defender", "time"):
            assert np.array_equal(found[name], getattr(expected, name))
