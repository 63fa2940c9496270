"""Without private parts of numba and llvmlite, and with a numba that nobody has tried."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

HIDE = """
import sys, numba
from importlib import import_module
from integrators.kernel.native import shipped
from pathlib import Path
shipped.FOLDER = Path("nowhere")  # else most of the kernel were compiled already
def hide(part):
    module, name = part.split(":")
    delattr(import_module(module), name)
"""
NEWER = """
import importlib.metadata
kept = importlib.metadata.version
importlib.metadata.version = lambda name: "0.99.0" if name == "numba" else kept(name)
"""
WITHOUT_MCJIT = """
from integrators.kernel.native import machine
class Binding:
    def __getattr__(self, name):
        if name == "create_mcjit_compiler":
            raise AttributeError(name)
        return getattr(binding, name)
binding, machine.llvm = machine.llvm, Binding()
"""
PRIVATE = "numba.core.registry:CPUTarget"  # numba itself needs it at its import only
WAYS = "import pytest; sys.exit(pytest.main([*{options!r}, '-W', 'default', *{tests!r}]))"
EACH_WAY = "tests/integrators/test_processors.py"
OPTIONS = ["-o", "addopts=", "-q", "-p", "no:cacheprovider"]
ROOT = Path(__file__).parents[4]
PACKAGES = "integrators", "problems", "hbvm_bench"


def run(tmp_path, code, cache="cache"):
    return subprocess.run(
        [sys.executable, "-c", HIDE + code], cwd=ROOT, capture_output=True, text=True, check=False,
        env={"HBVM_BENCH_CACHE": str(tmp_path / cache), "PATH": "", "HOME": str(tmp_path)},
    )  # fmt: skip


def test_one_file_imports_private_parts_of_numba():
    private = re.compile(r"\b(?:from|import) numba\.(?!extending\b)|\bnumba\.(?:core|np)\b")
    files = [file for package in PACKAGES for file in (ROOT / package).rglob("*.py")]
    found = [file for file in files if private.search(file.read_text("utf-8"))]
    assert found == [ROOT / "integrators/kernel/native/private.py"]


def test_a_numba_that_can_do_nothing_gives_a_sentence(tmp_path):
    hidden = f"hide({PRIVATE!r}); hide('numba.extending:overload_attribute')\n"
    done = run(tmp_path, hidden + "from integrators.kernel.native import jit")
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert "cannot compile the kernel (" in last
    assert last.endswith("pip install 'numba<0.69'")


def test_a_wrong_number_is_not_believed(tmp_path):
    wrong = "import llvmlite.binding as llvm\nfrom integrators.kernel.native import machine as native\n"
    wrong += "native.entry, kept = (lambda *a: kept(*a).replace('ret i64 %z', 'ret i64 17')), native.entry\n"
    done = run(tmp_path, NEWER + wrong + "from integrators.kernel.native import jit")
    assert done.returncode == 1
    assert "a sum of 18 is 17" in done.stderr.strip().splitlines()[-1]


OTHER_ATTRIBUTES = (
    NEWER
    + """
from integrators.kernel.native import private
private.attributes = lambda *arguments: None
"""
)


@pytest.mark.parametrize(
    ("shim", "way"),
    [(NEWER, "private"), (f"hide({PRIVATE!r})\n", "public"), (OTHER_ATTRIBUTES, "public")],
    ids=["the same", "parts are gone", "attributes do something else"],
)
def test_a_newer_numba_is_tried(tmp_path, shim, way):
    done = run(tmp_path, shim + "from integrators.kernel.native import jit; print(jit._way.__name__)")
    assert done.returncode == 0, done.stderr
    assert done.stdout.split(".")[-1].strip() == way
    assert done.stderr.count("RuntimeWarning: numba ") == (way == "public")


def by_the_public_interface(tmp_path, options, *tests):
    done = run(tmp_path, f"hide({PRIVATE!r})\n" + WAYS.format(options=OPTIONS + options, tests=tests))
    assert done.returncode == 0, done.stdout[-3000:]
    assert "numba's public interface" in done.stdout


def test_memory_by_name_by_the_public_interface(tmp_path):
    file = "tests/integrators/kernel/native/test_memory.py"
    by_the_public_interface(tmp_path, [], f"{file}::test_compiled_code_reads_and_writes_a_part")


@pytest.mark.slow
def test_each_way_through_the_kernel_by_the_public_interface(tmp_path):
    by_the_public_interface(tmp_path, ["-m", "portable"], EACH_WAY)


@pytest.mark.slow
def test_each_way_through_the_kernel_without_mcjit(tmp_path):
    done = run(tmp_path, WITHOUT_MCJIT + WAYS.format(options=[*OPTIONS, "-m", "portable"], tests=[EACH_WAY]))
    assert done.returncode == 0, done.stdout[-3000:]


def test_machine_code_is_loaded_without_mcjit(tmp_path):
    code = """
import ctypes
import llvmlite.binding as llvm
text = "define i64 @hbvm_entry(i64 %x) { %y = mul i64 %x, 3 ret i64 %y }"
for _ in range(2):  # two of the same name
    address = machine.load(machine.target_machine().emit_object(llvm.parse_assembly(text)))
    print(ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(address)(14))
"""
    done = run(tmp_path, WITHOUT_MCJIT + code)
    assert done.stdout.split() == ["42", "42"], done.stderr
