"""What hatchling runs before it makes a wheel: it compiles the kernel, so that a first use is a short one."""

import subprocess
import sys
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CompiledKernel(BuildHookInterface[Any]):
    """Writes ``integrators/kernel/shipped``, if numba and what the kernel needs are there."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        command = [sys.executable, "-c", "from integrators.kernel import ahead; ahead.ship()"]
        made = subprocess.run(command, cwd=self.root, capture_output=True, text=True, check=False)
        if made.returncode:
            last = made.stderr.strip().splitlines()[-1:]
            self.app.display_warning(
                f"the kernel is not compiled ahead, {' '.join(last)}: a first use takes some seconds longer."
            )
