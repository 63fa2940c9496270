"""Without a host everything else imports, and the plugin's error names the package to install."""

import subprocess
import sys

import pytest

BLOCKED = """
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {blocked!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Blocker())
import integrators, problems, integrators.plugins
import integrators.plugins.scipy
assert integrators.integrate(problems.load("kepler"), integrators.HBVM(k=4, s=2, h=0.1)).status == "finished"
try:
    import integrators.plugins.{host}
except ImportError as error:
    print(error)
"""


@pytest.mark.parametrize(
    ("host", "blocked"),
    [("rebound", ["rebound"]), ("diffrax", ["diffrax"]), ("diffrax", ["jax", "diffrax", "optimistix"])],
)
def test_without_a_host_the_plugin_says_what_to_install_and_the_rest_works(
    host: str, blocked: list[str]
) -> None:
    code = BLOCKED.format(host=host, blocked=blocked)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert f"{host} is not installed" in done.stdout
    assert 'pip install "hbvm-bench[peers]"' in done.stdout


def test_without_pytorch_the_plugin_says_what_to_install() -> None:
    code = BLOCKED.format(host="torch", blocked=["torch"])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "install it with pip install torch" in done.stdout
