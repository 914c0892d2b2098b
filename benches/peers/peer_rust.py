"""Peers from crates.io: the program in `rust/`, started once for every run."""

import json
import re
import subprocess

from model import BUILD, EXPORT, HERE

PROGRAM = BUILD / "cargo" / "release" / "peers"


class Rust:
    """One of the program's peers."""

    setting_name = "tolerance"
    settings = [10.0 ** (-k / 4) for k in range(24, 56)]

    def __init__(self, crate, method, cannot=None):
        self.crate, self.cannot = crate, cannot or {}
        self.name = f"{crate} {method}"
        lock = (HERE / "rust" / "Cargo.lock").read_text()
        self.version = re.search(f'name = "{crate}"\nversion = "(.*)"', lock).group(1)

    def check(self):
        """The right-hand sides at the shared model's samples."""
        return EXPORT["own"]

    def prepare(self, job, tolerance):
        """What runs the job up to a time."""

        def run(until_s):
            command = [PROGRAM, self.crate, job, repr(tolerance), str(until_s)]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                raise RuntimeError(done.stderr.strip().splitlines()[2:3] or done.returncode)
            return json.loads(done.stdout)

        return run
