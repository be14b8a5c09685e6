"""An export on Slurm by Dask: workers come and go, the export goes on.

pip install "scarl-sionna[dask]" dask-jobqueue
python examples/slurm_export.py data/ drive.yaml city.yaml --jobs 16

Run it on a login node or as a small job of its own. Workers need the folder and the scenarios under the same path.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from scarl_sionna.batch import ExportSettings, export
from scarl_sionna.scenario.spec.scenario import ScenarioSpec


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenarios", nargs="+", type=Path)
    parser.add_argument("--jobs", type=int, default=16, help="Slurm jobs, one worker each")
    parser.add_argument("--cores", type=int, default=8, help="cores of a worker; the engine uses them all")
    parser.add_argument("--memory", default="8GB")
    parser.add_argument("--walltime", default="08:00:00")
    parser.add_argument("--queue", default=None)
    options = parser.parse_args()

    from dask_jobqueue import SLURMCluster

    cluster = SLURMCluster(
        cores=1,  # one shard at a time: the engine solves on one thread of Python and on all cores of its own
        processes=1,
        job_cpu=options.cores,
        memory=options.memory,
        walltime=options.walltime,
        queue=options.queue,
        worker_extra_args=["--lifetime", "7h", "--lifetime-stagger", "10m"],  # before the time limit ends them
    )
    cluster.adapt(maximum_jobs=options.jobs)
    scenarios = [ScenarioSpec.load(path).with_(name=path.stem) for path in options.scenarios]
    settings = ExportSettings(scheduler=cluster.scheduler_address, on_error="record")
    print(export(scenarios, options.out, settings))


if __name__ == "__main__":
    main()
