"""The cache of scenes and actors.

Read-only and full disks, killed and concurrent processes, and what is removed when.
"""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from scarl_sionna.core.errors import SceneError
from scarl_sionna.scene.actors.model import read_actor_model
from scarl_sionna.scene.document.find import find_scene
from scenes_xml import actor_path, cache, cache_folder, scene_path
from scenes_xml.cache import DAY, clean, kept_folder

FILES = ("a.xml", "meshes/b.ply")


def _fill(folder: Path) -> None:
    (folder / "meshes").mkdir()
    (folder / "a.xml").write_text("a")
    (folder / "meshes" / "b.ply").write_text("b")


@pytest.fixture
def chosen(tmp_path, monkeypatch):
    """A cache folder that the user chose."""
    monkeypatch.setenv("SCARL_CACHE_DIR", str(tmp_path / "chosen"))
    return tmp_path / "chosen"


@pytest.fixture
def homes(tmp_path, monkeypatch):
    """A home folder and a folder for temporary files, none chosen: (cache in the home, cache among temporary files)."""
    monkeypatch.delenv("SCARL_CACHE_DIR", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    for name in ("home", "tmp"):
        (tmp_path / name).mkdir()
    return tmp_path / "home" / ".cache" / "scarl-sionna", tmp_path / "tmp" / f"scarl-sionna-{os.getuid()}"


def test_the_place_of_the_cache(homes, tmp_path, monkeypatch):
    assert cache_folder() == homes[0]
    monkeypatch.setenv("XDG_CACHE_HOME", "not/absolute")
    assert cache_folder() == homes[0]
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_folder() == tmp_path / "xdg" / "scarl-sionna"
    monkeypatch.setenv("SCARL_CACHE_DIR", "~/mine")
    assert cache_folder() == tmp_path / "home" / "mine"


def test_an_account_without_a_home_has_a_cache(homes, monkeypatch):
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", homeless)
    assert cache_folder() == homes[1]
    assert kept_folder("scenes", "x-1", FILES, _fill).is_relative_to(homes[1])
    assert homes[1].stat().st_mode & 0o077 == 0  # nobody else reads or writes there


@pytest.mark.parametrize("code", [errno.EROFS, errno.EACCES, errno.ENOSPC])
def test_a_home_that_cannot_be_written_is_replaced_with_a_warning(homes, monkeypatch, code):
    real = Path.mkdir

    def mkdir(self: Path, *args, **kwargs) -> None:
        if self.is_relative_to(homes[0]):
            raise OSError(code, os.strerror(code))
        real(self, *args, **kwargs)

    monkeypatch.setattr(Path, "mkdir", mkdir)
    with pytest.warns(UserWarning, match=f"{os.strerror(code)}.*SCARL_CACHE_DIR.*For now it lies in"):
        assert find_scene("tunnel").is_relative_to(homes[1])
    assert find_scene("tunnel").is_relative_to(homes[1])  # it lies there now: no second warning


def test_what_lies_in_a_cache_that_cannot_be_written_is_used(chosen, monkeypatch):
    path = scene_path("tunnel")
    os.utime(path.parent, (time.time() - DAY,) * 2)

    def refused(*args, **kwargs):
        raise PermissionError(errno.EACCES, "Permission denied")

    for name in ("mkdir", "rename"):
        monkeypatch.setattr(Path, name, refused)
    monkeypatch.setattr(os, "utime", refused)
    monkeypatch.setattr(cache, "FileLock", refused)
    assert scene_path("tunnel") == path


@pytest.mark.parametrize("load", [lambda: find_scene("tunnel"), lambda: read_actor_model("saloon")])
def test_a_chosen_folder_that_cannot_be_written_is_an_error(chosen, load):
    chosen.write_text("a file")
    with pytest.raises(SceneError, match="set SCARL_CACHE_DIR to a folder that can be written"):
        load()


def test_folders_for_temporary_files_of_others_are_not_trusted(homes, tmp_path, monkeypatch):
    homes[0].parent.mkdir()
    homes[0].write_text("a file")
    theirs = tmp_path / "elsewhere"
    (theirs / "scenes" / "x-1").mkdir(parents=True)
    _fill(theirs / "scenes" / "x-1")  # whole, and perhaps evil
    homes[1].symlink_to(theirs)
    with pytest.raises(OSError, match="SCARL_CACHE_DIR"):
        kept_folder("scenes", "x-1", FILES, _fill)
    homes[1].unlink()
    theirs.rename(homes[1])
    mine = os.getuid()
    assert kept_folder("scenes", "x-1", FILES, _fill).is_relative_to(homes[1])
    monkeypatch.setattr(cache, "fallback_folder", lambda: homes[1])
    monkeypatch.setattr(os, "getuid", lambda: mine + 1)
    with pytest.raises(OSError, match="SCARL_CACHE_DIR"):
        kept_folder("scenes", "x-1", FILES, _fill)


def test_a_full_disk_leaves_nothing_behind(chosen, monkeypatch):
    def full(self: Path, data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        with pytest.raises(OSError, match="No space left on device; free space there"):
            actor_path("saloon")
    assert not list((chosen / "models").iterdir())
    assert actor_path("saloon").is_file()


def test_a_folder_with_holes_is_filled_again(chosen):
    path = actor_path("saloon")
    mesh = path.parent / "meshes" / "body.ply"
    content = mesh.read_bytes()
    for damage in (mesh.unlink, lambda: mesh.write_bytes(b"")):
        damage()
        cache._whole.clear()  # as in a new process
        assert actor_path("saloon") == path and mesh.read_bytes() == content


def _python(code: str, root: Path) -> subprocess.Popen:
    environment = os.environ | {"SCARL_CACHE_DIR": str(root)}
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, env=environment, text=True)


def test_after_a_process_killed_in_mid_unpack_the_next_one_does_the_work(chosen):
    code = (
        "import os, pathlib, time; from scenes_xml import actor_path; write = pathlib.Path.write_bytes\n"
        "def slow(self, data): write(self, data); os.write(1, f'{self}\\n'.encode()); time.sleep(60)\n"
        "pathlib.Path.write_bytes = slow; actor_path('saloon')"
    )
    process = _python(code, chosen)
    half = Path(process.stdout.readline().strip())
    process.send_signal(signal.SIGKILL)
    process.wait(60)
    process.stdout.close()
    assert half.is_file() and not list((chosen / "models").glob("saloon-*"))
    start = time.perf_counter()
    assert actor_path("saloon").is_file()
    assert (
        time.perf_counter() - start < 30.0
    )  # the lock of the dead does not hold; the wait for one that lives is 600 s
    left = half.relative_to(chosen / "models").parts[0]
    assert (chosen / "models" / left).is_dir()
    assert clean(chosen) == [] and clean(chosen, time.time() + 1.1 * DAY) == [chosen / "models" / left]


def test_several_processes_at_once_do_the_work_once(chosen):
    code = (
        "from scenes_xml import packing, actor_path; unpack = packing.unpack_into\n"
        "def counted(*args): print('unpacked', flush=True); unpack(*args)\n"
        "packing.unpack_into = counted; print(actor_path('saloon'))"
    )
    processes = [_python(code, chosen) for _ in range(3)]
    lines = [process.communicate(timeout=120)[0].split() for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0]
    assert sum(line.count("unpacked") for line in lines) == 1
    assert len({line[-1] for line in lines}) == 1
    assert len(list((chosen / "models").iterdir())) == 1


def test_without_locks_the_first_to_finish_wins(chosen, monkeypatch):
    class NoLock:
        def __init__(self, *args, **kwargs) -> None: ...

        def acquire(self) -> None:
            raise NotImplementedError("FileSystem does not appear to support flock")

        def release(self) -> None: ...

    monkeypatch.setattr(cache, "FileLock", NoLock)
    barrier = threading.Barrier(2)

    def fill(folder: Path) -> None:
        _fill(folder)
        barrier.wait(30)

    found = []
    threads = [
        threading.Thread(target=lambda: found.append(kept_folder("scenes", "x-1", FILES, fill))) for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert found == [chosen / "scenes" / "x-1"] * 2
    assert [file.name for file in (chosen / "scenes").iterdir()] == ["x-1"]


def _aged(folder: Path, days: float) -> Path:
    folder.mkdir(parents=True)
    os.utime(folder, (time.time() - days * DAY,) * 2)
    return folder


def test_what_was_not_used_for_weeks_is_removed(chosen):
    scenes = chosen / "scenes"
    superseded = _aged(scenes / "tunnel-v1-light-aaa", 15)
    kept = [
        _aged(scenes / "tunnel-v1-light-bbb", 13),  # another process with an older package may still use it
        _aged(scenes / "tunnel-v2-light-aaa", 50),  # the only one of its name
        _aged(chosen / "actors" / "mine-aaa", 500),  # made from a user's mesh
        _aged(chosen / "actors" / "mine-bbb", 600),
        _aged(scenes / ".tunnel-v1-light-ccc-x1y2", 0.5),  # perhaps being filled
    ]
    unused = [_aged(scenes / "tunnel-v3-light-aaa", 61), _aged(scenes / ".tunnel-v1-light-ccc-q3r4", 1.5)]
    unused.append(_aged(chosen / "actors" / ".mine-ccc-x5y6", 1.5))
    kept.append(kept_folder("scenes", "tunnel-v1-light-ddd", FILES, _fill))
    assert not [folder for folder in (superseded, *unused) if folder.exists()]
    assert [folder for folder in kept if folder.exists()] == kept


def test_use_keeps_a_folder(chosen):
    folder = kept_folder("scenes", "tunnel-v1-light-aaa", FILES, _fill)
    os.utime(folder, (time.time() - 59 * DAY,) * 2)
    assert kept_folder("scenes", "tunnel-v1-light-aaa", FILES, _fill) == folder
    assert clean(chosen, time.time() + 59 * DAY) == [] and folder.is_dir()
    assert clean(chosen, time.time() + 61 * DAY) == [folder] and not folder.exists()


def test_a_folder_that_another_process_fills_or_just_took_into_use_stays(chosen):
    folder = _aged(chosen / "scenes" / "tunnel-v1-light-aaa", 100)
    (chosen / "locks").mkdir()
    with cache.FileLock(chosen / "locks" / "scenes-tunnel-v1-light-aaa.lock"):
        assert clean(chosen) == [] and folder.is_dir()
    used = folder.stat().st_mtime
    os.utime(folder)  # between the look at all folders and the removal of this one
    assert cache._removed(chosen, "scenes", folder, used) == [] and folder.is_dir()
