"""A process with few threads still renders and writes images."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from scarl_sionna.core.cores import one_blas_thread

CODE = """
from scarl_sionna.engine.threads import limit_threads
from scarl_sionna.engine import variant
limit_threads(1)
import drjit
print(drjit.thread_count())
with variant.optical():
    import mitsuba as mi
    import numpy as np
    mi.Bitmap(np.ones((64, 64, 3), np.float32)).write({path!r})
"""


STRETCHES = """
from scarl_sionna.engine import threads, variant
threads.limit_threads(3)
import drjit
found = []
note = lambda: found.append(drjit.thread_count())
with threads.many_threads():
    note()
with threads.few_threads():
    note()
    with threads.many_threads():
        note()
    with threads.many_threads(threads.RAYS_PER_THREAD - 1):
        note()
    with threads.few_threads(), threads.many_threads(threads.RAYS_PER_THREAD):
        note()
    with threads.many_threads(100 * threads.RAYS_PER_THREAD):
        with threads.many_threads(threads.RAYS_PER_THREAD):
            note()
        with variant.optical():
            import mitsuba as mi
            import numpy as np
            mi.Bitmap(np.ones((64, 64, 3), np.float32)).write({path!r})
    note()
note()
try:
    with threads.few_threads():
        raise KeyError
except KeyError:
    note()
print(*found)
"""


IDLE = """
import time
from scarl_sionna.engine import threads, variant
threads.limit_threads(2)
import drjit as dr

def idle(mi):
    numbers, begin = dr.arange(mi.Float, 100_000), (time.process_time(), time.thread_time())
    for _ in range(30):
        dr.sin(numbers + dr.opaque(mi.Float, 1.0)).numpy()
        until = time.thread_time() + 0.003
        while time.thread_time() < until:
            pass
    return time.process_time() - begin[0] - (time.thread_time() - begin[1])

with variant.optical() as mi:
    idle(mi)
    as_it_is = idle(mi)
    with threads.few_threads():
        print(as_it_is, idle(mi))
"""


PENDING = """
from scarl_sionna.engine import threads
from scarl_sionna.engine.backend.bootstrap import ensure_engine
ensure_engine()
import drjit
import drjit.llvm as llvm
import numpy as np
threads.limit_threads(2)
rng = np.random.default_rng(1)
number = drjit.arange(llvm.UInt32, 200_000)
for _ in range(150):
    threads.limit_threads(int(rng.choice([2, 4, 16])))
    with threads.few_threads():
        sums = drjit.zeros(llvm.Float64, 64)
        drjit.scatter_add(sums, llvm.Float64(number % 7), number & 63)
        if rng.random() < 0.5:
            drjit.eval(sums)  # begins, and runs on
        with threads.many_threads():
            total = drjit.sum(drjit.sin(llvm.Float64(number)))
            drjit.eval(total)
    assert np.all(sums.numpy() == WANTED)
"""


def test_threads_come_and_go_while_sums_wait() -> None:
    """Sums have a copy for each thread: one more that joined wrote beyond them, and the process aborted."""
    number = np.arange(200_000)
    wanted = np.bincount(number & 63, number % 7)
    code = PENDING.replace("WANTED", f"np.array({wanted.tolist()})")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[-2000:]


TOGETHER = """
import threading
from scarl_sionna.engine import threads
threads.limit_threads(3)
import drjit
found, there, leave = [], threading.Event(), threading.Event()

def other():
    with threads.few_threads():
        there.set()
        leave.wait()

one = threading.Thread(target=other)
with threads.few_threads():
    one.start()
    there.wait()
    with threads.many_threads():
        found.append(drjit.thread_count())
found.append(drjit.thread_count())
leave.set()
one.join()
found.append(drjit.thread_count())
print(*found)
"""


@pytest.fixture(scope="module")
def told(tmp_path_factory) -> tuple[dict[str, list[str]], Path]:
    """Return what each part prints, and where they write images.

    One after the other in a process of their own, since the count of threads is the process's.
    """
    folder = tmp_path_factory.mktemp("threads")
    parts = {
        "fewest": CODE.format(path=str(folder / "fewest.exr")),
        "stretches": STRETCHES.format(path=str(folder / "stretches.exr")),
        "together": TOGETHER,
        "idle": IDLE,
    }
    code = "".join(f"print({name!r}, flush=True, end=' ')\nexec({text!r}, {{}})\n" for name, text in parts.items())
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return {words[0]: words[1:] for words in map(str.split, done.stdout.splitlines())}, folder


def test_a_process_with_the_fewest_threads_writes_an_image(told) -> None:
    """With a thread count of one it would hang (Mitsuba 3.9.1, Dr.Jit 1.5.0)."""
    said, folder = told
    assert said["fewest"] == ["2"]
    assert (folder / "fewest.exr").stat().st_size > 0


def test_stretches_of_small_kernels_leave_other_threads_out_and_large_ones_take_them_in(told) -> None:
    """The image would hang with one thread."""
    said, folder = told
    assert [int(count) for count in said["stretches"]] == [3, 1, 3, 1, 2, 3, 1, 3, 3]
    assert (folder / "stretches.exr").stat().st_size > 0


def test_idle_threads_cost_no_processor_time_between_small_kernels(told) -> None:
    """The reason for few_threads: what other threads of the process take while the caller works for 30 x 3 ms."""
    as_it_is, few = (float(value) for value in told[0]["idle"])
    assert few < 0.02  # 0.00 s here
    assert few < as_it_is  # 0.08 s; less where other processes take the core


def test_who_is_not_alone_changes_no_number_of_threads(told) -> None:
    assert told[0]["together"] == ["1", "1", "3"]


def test_blas_has_one_thread_until_all_that_asked_for_one_have_left() -> None:
    """Contexts of two threads overlap: the second one's undoing is not that of the first."""

    def threads() -> set[int]:
        return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

    with threadpool_limits(2, user_api="blas"):
        one, other = one_blas_thread(), one_blas_thread()
        one.__enter__()
        other.__enter__()
        assert threads() == {1}
        one.__exit__(None, None, None)
        assert threads() == {1}
        other.__exit__(None, None, None)
        assert threads() == {2}
