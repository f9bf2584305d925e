"""A Slurm of one node for tests: its own munged, slurmctld and slurmd, of this user and on free ports."""

from __future__ import annotations

import contextlib
import os
import pwd
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Self

import psutil
from commands import ENVIRONMENT, wait_for

SYSTEM = os.pathsep.join([os.environ["PATH"], "/usr/sbin", "/sbin"])  # where Debian has the daemons
PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "scontrol", "scancel", "squeue", "setpriv")
OVER = ("COMPLETED", "FAILED", "CANCELLED", "TIMEOUT")  # states of jobs that have ended
PATIENCE = 30.0  # seconds of a daemon that starts

CONFIGURATION = """\
ClusterName=hexcontact
SlurmctldHost={host}(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket={folder}/munge.sock
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin={task}
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=none
ReturnToService=2
SchedulerParameters=batch_sched_delay=0,sched_interval=1
NodeName=node NodeHostname={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory=4000
PartitionName=batch Nodes=node Default=YES MaxTime=INFINITE State=UP
"""


class Absent(Exception):
    """Slurm cannot run here."""


class SlurmNode:
    """Start the daemons on entry; on exit cancel all jobs and end the daemons."""

    def __init__(self) -> None:
        missing = [name for name in PROGRAMS if shutil.which(name, path=SYSTEM) is None]
        if missing:
            raise Absent(f"not installed: {', '.join(missing)}")
        self.cores = len(os.sched_getaffinity(0))
        self.folder = Path(tempfile.mkdtemp(prefix="slurm"))  # names of sockets are short
        self._daemons: list[subprocess.Popen[bytes]] = []
        self.environment = {
            **{key: value for key, value in ENVIRONMENT.items() if not key.startswith(("SLURM", "SBATCH"))},
            "PATH": SYSTEM,
            "SLURM_CONF": str(self.folder / "slurm.conf"),
        }
        del self.environment["OMP_NUM_THREADS"]

    def __enter__(self) -> Self:
        try:
            self._start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def _start(self) -> None:
        folder, host = self.folder, socket.gethostname().partition(".")[0]
        for name in ("state", "spool"):
            (folder / name).mkdir()
        (folder / "munge.key").touch(0o600)
        (folder / "munge.key").write_bytes(os.urandom(128))
        values = {"folder": folder, "host": host, "user": _user(), "ports": _free_ports(2)}
        task = "task/affinity" if self.cores > 1 else "task/none"
        text = CONFIGURATION.format(**values, cores=self.cores, task=task)
        (folder / "slurm.conf").write_text(text)
        files = {"key-file": "key", "socket": "sock", "pid-file": "pid", "seed-file": "seed"}
        options = [f"--{option}={folder}/munge.{name}" for option, name in files.items()]
        self._daemon("munged", "--foreground", "--force", *options)
        self._until_there(lambda: (folder / "munge.sock").exists())
        self._daemon("slurmctld", "-D")
        self._daemon("slurmd", "-D", "-N", "node")
        self._until_there(lambda: self.command("sinfo", "-h", "-o", "%T").stdout.strip() == "idle")

    def _daemon(self, *words: str) -> None:
        """Start a daemon that ends with this process."""
        with (self.folder / f"{words[0]}.log").open("wb") as log:
            words = ("setpriv", "--pdeathsig", "KILL", *words)
            self._daemons.append(subprocess.Popen(words, stdout=log, stderr=log, env=self.environment))

    def _until_there(self, look: Callable[[], bool]) -> None:
        limit = time.monotonic() + PATIENCE
        while not look():
            ended = [daemon for daemon in self._daemons if daemon.poll() is not None]
            if ended or time.monotonic() > limit:
                last = [
                    line for log in self.folder.glob("*.log") for line in log.read_text().splitlines()[-2:]
                ]
                raise Absent("its daemons do not start: " + " | ".join(last))
            time.sleep(0.05)

    def command(self, *words: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
        """Run a command of Slurm, or a script that calls some."""
        return subprocess.run(words, env=self.environment, cwd=cwd, capture_output=True, text=True)

    def submit(self, *words: str | Path, cwd: Path) -> str:
        """Submit a job and return its number."""
        done = self.command("sbatch", "--parsable", *map(str, words), cwd=cwd)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def wait(self, *, jobs: str = "") -> None:
        """Wait until jobs, or all, have ended.

        A requeued job waits for two minutes. Here it starts as soon as its former script has ended, whose
        exit code would otherwise end the new attempt.
        """

        def ended() -> bool:
            chosen = [f"--jobs={jobs}"] if jobs else []
            listed = self.command("squeue", "-h", "--states=all", "-o", "%A %T %r", *chosen)
            lines = [line.split() for line in listed.stdout.splitlines()]
            for number, state, reason in lines:
                if (state, reason) == ("PENDING", "BeginTime") and not _has_steps(number):
                    self.command("scontrol", "update", f"jobid={number}", "starttime=now")
            time.sleep(0.2)
            return listed.returncode == 0 and all(state in OVER for _, state, _ in lines)

        wait_for(ended)

    def job(self, number: str) -> dict[str, str]:
        """Return the entries that Slurm has on a job."""
        shown = self.command("scontrol", "--oneliner", "show", "job", number).stdout
        return dict(word.split("=", 1) for word in shown.split() if "=" in word)

    def stop(self) -> None:
        """Cancel all jobs, end the daemons, and delete their files."""
        if len(self._daemons) == 3:
            self.command("scancel", "--user", _user())
            with contextlib.suppress(AssertionError):
                self.wait()
        for daemon in reversed(self._daemons):
            daemon.terminate()
        for daemon in self._daemons:
            try:
                daemon.wait(10)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


def _has_steps(job: str) -> bool:
    """Test whether a script or a step of a job still runs, or ends, and has no command line any more."""
    found = (process.info for process in psutil.process_iter(["name", "cmdline"]))
    steps = [info["cmdline"] for info in found if info["name"] == "slurmstepd"]
    return any(not words or words[-1].startswith(f"[{job}.") for words in steps)


def _user() -> str:
    return pwd.getpwuid(os.getuid()).pw_name


def _free_ports(number: int) -> list[int]:
    """Return ports that nobody uses at the moment."""

    def bound() -> Iterator[socket.socket]:
        for _ in range(number):
            end = socket.socket()
            end.bind(("127.0.0.1", 0))
            yield end

    ends = list(bound())
    ports = [end.getsockname()[1] for end in ends]
    for end in ends:
        end.close()
    return ports
