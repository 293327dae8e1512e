"""Have the nodes of a Slurm cluster make a data set: start this on the login node and leave it running.

    pip install '.[blender,cluster]'        # in a copy of the repository
    python docs/slurm_cluster.py reference /shared/reference --jobs 20

One Slurm job is one Dask worker, which makes one scene at a time on all of its cores. The folder must be on a file
system that all nodes see.
`--print-script` shows the job script and ends.
"""

from __future__ import annotations

import argparse
import subprocess
import sys

from dask_jobqueue import SLURMCluster


def main() -> int:
    """Start the cluster, make the data set with it, and stop it again."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recipe")
    parser.add_argument("output")
    parser.add_argument("--jobs", type=int, default=10, help="Slurm jobs at once")
    parser.add_argument("--cores", type=int, default=2, help="cores of a job")
    parser.add_argument("--memory", default="4GB", help="memory of a job")
    parser.add_argument("--walltime", default="04:00:00", help="after this a job is stopped; its scene is made again")
    parser.add_argument("--queue", help="partition")
    parser.add_argument("--interface", help="network interface that all nodes see, e.g. ib0")
    parser.add_argument("--print-script", action="store_true")
    options = parser.parse_args()
    cluster = SLURMCluster(
        cores=1,  # scenes at once
        job_cpu=options.cores,
        processes=1,
        memory=options.memory,
        walltime=options.walltime,
        queue=options.queue,
        interface=options.interface,
    )
    if options.print_script:
        print(cluster.job_script())
        return 0
    cluster.scale(jobs=options.jobs)
    command = [sys.executable, "-m", "headless.dataset", options.recipe, "--output", options.output, "--resume"]
    return subprocess.run([*command, "--scheduler", cluster.scheduler_address], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
