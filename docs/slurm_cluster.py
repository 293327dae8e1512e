"""Have the nodes of a Slurm cluster make a data set: start this on the login node and leave it running.

    pip install '.[blender,cluster]'        # in a copy of the repository
    python docs/slurm_cluster.py reference /shared/reference --jobs 20

One Slurm job is one Dask worker, which makes one scene at a time on all of its cores. The folder must be on a file
system that all nodes see. A worker leaves before its wall time ends, and for each job that ended, however it did,
another is submitted. Everything between scheduler and workers is encrypted, with a certificate made for this run.
`--print-script` shows the job script and ends.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from dask_jobqueue import SLURMCluster
from distributed.security import Security

LOOK = 10.0
"""Seconds between two looks at the jobs."""


def lifetime(walltime: str) -> float:
    """Return after how many seconds a worker leaves: before the end by a quarter of its wall time, at most 5 minutes.

    Args:
        walltime: [days-]hours:minutes:seconds, as Slurm takes it.
    """
    days, _, clock = walltime.rpartition("-")
    hours, minutes, seconds = (float(part) for part in clock.split(":"))
    whole = ((float(days or 0) * 24 + hours) * 60 + minutes) * 60 + seconds
    return max(0.75 * whole, whole - 300.0)


def keep_jobs(cluster: SLURMCluster, count: int) -> None:
    """Submit a job for each one that has ended, so that there are `count` again."""
    command = ["squeue", "--noheader", "--me", "--format=%i"]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    if answer.returncode == 0:  # else Slurm has no time for us now
        alive = set(answer.stdout.split())
        for name, job in list(cluster.workers.items()):
            if job.job_id and job.job_id not in alive:
                del cluster.workers[name]
    cluster.scale(count)


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
    options, more = parser.parse_known_args()
    # Beside the data set, which all nodes see; only their user can read it.
    with tempfile.TemporaryDirectory(prefix=".dask-", dir=Path(options.output).absolute().parent) as secrets:
        cluster = start_cluster(options, secrets)
        if options.print_script:
            print(cluster.job_script())
            return 0
        return run(cluster, options, more)


def start_cluster(options: argparse.Namespace, secrets: str) -> SLURMCluster:
    """Start the scheduler, and describe the jobs that become its workers."""
    return SLURMCluster(
        cores=1,  # scenes at once
        job_cpu=options.cores,
        processes=1,
        memory=options.memory,
        walltime=options.walltime,
        queue=options.queue,
        interface=options.interface,
        security=write_certificate(Path(secrets)),
        worker_extra_args=["--lifetime", f"{lifetime(options.walltime):g}s"],
    )


def run(cluster: SLURMCluster, options: argparse.Namespace, more: list[str]) -> int:
    """Make the data set with the cluster's workers; return the command's exit code."""
    keep_jobs(cluster, options.jobs)
    command = [sys.executable, "-m", "headless.dataset", options.recipe, "--output", options.output, "--resume", *more]
    process = subprocess.Popen(
        [*command, "--scheduler", cluster.scheduler_address],
        env={**os.environ, **client_settings(cluster.security)},
    )
    try:
        while process.poll() is None:
            time.sleep(LOOK)
            keep_jobs(cluster, options.jobs)
    finally:
        process.terminate()
        process.wait()
        cluster.close()
    return process.returncode


def write_certificate(folder: Path) -> Security:
    """Write a certificate and its key, for this run alone, readable by nobody else; return what names the files."""
    new = Security.temporary()
    for name, text in {"ca": new.tls_ca_file, "cert": new.tls_client_cert, "key": new.tls_client_key}.items():
        (folder / name).touch(mode=0o600)
        (folder / name).write_text(text, encoding="utf-8")
    roles = {
        f"tls_{role}_{name}": str(folder / name)
        for role in ("scheduler", "worker", "client")
        for name in ("cert", "key")
    }
    return Security(require_encryption=True, tls_ca_file=str(folder / "ca"), **roles)


def client_settings(security: Security) -> dict[str, str]:
    """Return the settings of Dask, as variables of the environment, by which the scheduler lets the command in."""
    files = {"CA_FILE": security.tls_ca_file, "CLIENT__CERT": security.tls_client_cert}
    files["CLIENT__KEY"] = security.tls_client_key
    return {f"DASK_DISTRIBUTED__COMM__TLS__{name}": path for name, path in files.items()}


if __name__ == "__main__":
    sys.exit(main())
