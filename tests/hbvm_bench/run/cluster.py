"""A dask cluster of processes: a scheduler and workers that can be killed."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

# no pickled code runs anywhere but on this machine
LOCAL = ["--host", "127.0.0.1"]


class Cluster:
    """Start a scheduler and ``count`` workers of one thread each; all end with the context."""

    def __init__(self, folder, count):
        self.folder, self.count = Path(folder), count
        self.processes = []

    def __enter__(self):
        file = self.folder / "scheduler.json"
        scheduler = [*LOCAL, "--port", "0", "--no-dashboard", "--no-show", "--scheduler-file", str(file)]
        self.scheduler = self._start("scheduler", *scheduler)
        self.wait_for(file.exists, "scheduler")
        self.address = json.loads(file.read_text())["address"].removeprefix("tcp://")
        worker = [*LOCAL, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--memory-limit", "0"]
        self.workers = [
            self._start("worker", *worker, "--death-timeout", "20", f"tcp://{self.address}")
            for _ in range(self.count)
        ]
        return self

    def __exit__(self, *exc):
        for process in self.processes:
            process.kill()
            process.wait()

    def kill(self, process):
        os.kill(process.pid, signal.SIGKILL)
        process.wait()

    def _start(self, what, *options):
        log = (self.folder / f"{what}{len(self.processes)}.log").open("w")
        command = [sys.executable, "-m", "dask", what, *options]
        with contextlib.closing(log):
            made = subprocess.Popen(command, cwd=self.folder, stdout=log, stderr=log)
        self.processes.append(made)
        return made

    def wait_for(self, ready, what, seconds=60):
        deadline = time.monotonic() + seconds
        while not ready():
            assert time.monotonic() < deadline, f"the {what} did not start"
            time.sleep(0.05)
