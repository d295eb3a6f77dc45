"""Every kind of place a file can be written to: what is there stays what it is, and no file is ever half there."""

import errno
import os
import resource
import socket
import stat
import subprocess
import sys
import tempfile
import threading
from contextlib import contextmanager
from pathlib import Path

import pytest

from tadcore._shared.files import destination, write_whole, written

pytestmark = pytest.mark.skipif(os.name != "posix", reason="modes, links and devices of POSIX")
ROOT = os.geteuid() == 0 if hasattr(os, "geteuid") else False


@contextmanager
def umask(mask):
    before = os.umask(mask)
    try:
        yield
    finally:
        os.umask(before)


@contextmanager
def ordinary_user():
    """The rights of nobody, where the superuser runs the tests."""
    if ROOT:
        os.seteuid(65534)
    try:
        yield
    finally:
        if ROOT:
            os.seteuid(0)


@pytest.fixture
def anywhere():
    """A folder that every user can reach, as the folders of pytest are not."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o777)
        yield Path(folder)


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o000])
def test_a_new_file_has_the_mode_of_the_umask(tmp_path, mask):
    with umask(mask):
        write_whole(tmp_path / "new", "text")
        (tmp_path / "plain").write_text("text")
    assert mode(tmp_path / "new") == mode(tmp_path / "plain") == 0o666 & ~mask


def test_the_umask_of_the_process_is_never_touched(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "umask", lambda mask: pytest.fail("another thread's files would have this umask"))
    write_whole(tmp_path / "new", "text")
    write_whole(tmp_path / "new", "again")


@pytest.mark.parametrize("kept", [0o640, 0o600, 0o666, 0o755, 0o664])
def test_a_file_keeps_its_mode_and_is_never_more_open_on_the_way(tmp_path, kept):
    path = tmp_path / "file"
    path.write_text("before")
    path.chmod(kept)
    with umask(0o022), written(path) as partial:
        assert mode(partial) & ~kept == 0
        partial.write_text("after")
        assert path.read_text() == "before"
    assert (mode(path), path.read_text(), names(tmp_path)) == (kept, "after", ["file"])


@pytest.mark.skipif(not ROOT, reason="only the superuser gives files away")
def test_a_file_of_another_user_stays_theirs(tmp_path):
    path = tmp_path / "file"
    path.write_text("before")
    os.chown(path, 1234, 2345)
    path.chmod(0o640)
    write_whole(path, "after")
    assert (path.stat().st_uid, path.stat().st_gid, mode(path)) == (1234, 2345, 0o640)


@pytest.mark.parametrize("chain", [["target"], ["./target"], ["one", "two", "target"], ["deep/../target"]])
@pytest.mark.parametrize("dangling", [False, True])
def test_links_stay_and_what_they_lead_to_is_written(tmp_path, chain, dangling):
    (tmp_path / "deep").mkdir()
    if not dangling:
        (tmp_path / "target").write_text("before")
        (tmp_path / "target").chmod(0o640)
    link = tmp_path / "link"
    for name, leads_to in zip(["link", *chain], chain, strict=False):
        (tmp_path / name).symlink_to(leads_to)
    inside = names(tmp_path)
    write_whole(link, "after")
    assert link.is_symlink()
    assert (tmp_path / "target").read_text() == "after"
    assert not (tmp_path / "target").is_symlink()
    assert names(tmp_path) == sorted({*inside, "target"})
    assert dangling or mode(tmp_path / "target") == 0o640


def test_a_link_into_another_folder_leaves_nothing_beside_itself(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "link").symlink_to(tmp_path / "there" / "file.txt")
    with written(tmp_path / "here" / "link") as partial:
        assert partial.parent == (tmp_path / "there").resolve()
    assert names(tmp_path / "there") == ["file.txt"]
    assert names(tmp_path / "here") == ["link"]


def test_links_that_lead_nowhere_are_refused_by_name(tmp_path):
    for name, leads_to in (("a", "b"), ("b", "a"), ("self", "self"), ("lost", "no/such/folder/file")):
        (tmp_path / name).symlink_to(leads_to)
    for name, number in (("a", errno.ELOOP), ("self", errno.ELOOP), ("lost", errno.ENOENT)):
        with pytest.raises(OSError, match=name) as caught:
            write_whole(tmp_path / name, "text")
        assert (caught.value.errno, caught.value.filename) == (number, str(tmp_path / name))
    assert names(tmp_path) == ["a", "b", "lost", "self"]


def received(fifo, into):
    into.append(fifo.read_bytes())


@pytest.mark.parametrize("by_link", [False, True])
def test_a_pipe_receives_the_content_and_stays_a_pipe(tmp_path, by_link):
    fifo, got = tmp_path / "fifo", []
    os.mkfifo(fifo)
    (tmp_path / "link").symlink_to("fifo")
    reader = threading.Thread(target=received, args=(fifo, got))
    reader.start()
    content = os.urandom(300_000)  # more than a pipe holds
    write_whole(tmp_path / "link" if by_link else fifo, content)
    reader.join(20)
    assert got == [content]
    assert stat.S_ISFIFO(fifo.stat().st_mode)
    assert names(tmp_path) == ["fifo", "link"]


def test_a_pipe_that_nobody_reads_is_refused_and_not_waited_for(tmp_path, monkeypatch):
    monkeypatch.setattr("tadcore._shared.files._PATIENCE", 0.1)
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(OSError, match=r"nobody reads this pipe.*fifo"):
        write_whole(tmp_path / "fifo", "text")
    assert stat.S_ISFIFO((tmp_path / "fifo").stat().st_mode)


def device(path, like):
    kind = stat.S_IFCHR | 0o666
    try:
        os.mknod(path, kind, Path(like).stat().st_rdev)
        path.open("wb").close()
    except OSError as error:
        pytest.skip(f"no device can be made here ({error.strerror})")


@pytest.mark.skipif(not ROOT, reason="only the superuser makes devices")
def test_a_device_receives_the_content_and_stays_a_device(tmp_path):
    null, full = tmp_path / "null", tmp_path / "full"
    device(null, "/dev/null")
    device(full, "/dev/full")
    write_whole(null, "text")
    with pytest.raises(OSError, match="full") as caught:
        write_whole(full, "text")
    assert (caught.value.errno, caught.value.filename) == (errno.ENOSPC, str(full))
    assert all(stat.S_ISCHR(path.stat().st_mode) for path in (null, full))
    assert names(tmp_path) == ["full", "null"]


def test_folders_and_sockets_are_refused_by_name_before_anything_is_made(tmp_path, monkeypatch):
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to("folder")
    monkeypatch.chdir(tmp_path)  # the name of a socket is short
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind("socket")
        for name, words in (("folder", "a folder"), ("link", "a folder"), ("socket", "a socket")):
            for use in (destination, lambda path: write_whole(path, "text")):
                with pytest.raises(OSError, match=f"it is {words}, and must be a file") as caught:
                    use(tmp_path / name)
                assert caught.value.filename == str(tmp_path / name)
    assert names(tmp_path) == ["folder", "link", "socket"]
    assert names(tmp_path / "folder") == []


PRINTS = """
import sys
from tadcore._shared.files import write_whole
print("before")
write_whole(sys.argv[1], "content\\n")
print("behind", flush=True)
"""


@pytest.mark.parametrize("name", ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1", "link"])
@pytest.mark.parametrize("to", ["pipe", "file", "end of file"])
def test_standard_output_is_written_in_order(tmp_path, name, to):
    if name == "link":
        name = tmp_path / "link"
        name.symlink_to("/dev/stdout")
    elif not Path(name).exists():
        pytest.skip(f"no {name} here")
    command, wanted = [sys.executable, "-c", PRINTS, name], "before\ncontent\nbehind\n"
    if to == "pipe":
        assert subprocess.run(command, check=True, capture_output=True, text=True).stdout == wanted
        return
    out = tmp_path / "out"
    out.write_text("there\n")
    with out.open("a" if to == "end of file" else "w") as stream:
        subprocess.run(command, check=True, stdout=stream)
    assert out.read_text() == ("there\n" if to == "end of file" else "") + wanted


def test_standard_output_may_be_a_socket():
    ours, theirs = socket.socketpair()
    with ours, theirs:
        subprocess.run([sys.executable, "-c", PRINTS, "/dev/stdout"], check=True, stdout=theirs)
        theirs.close()
        assert ours.makefile().read() == "before\ncontent\nbehind\n"


@pytest.mark.parametrize("name", ["x" * 255, "x" * 251 + ".svg", "é" * 127, "x." + "y" * 253, "." + "x" * 254])
def test_every_legal_name_can_be_written(tmp_path, name):
    write_whole(tmp_path / name, "before")
    with written(tmp_path / name) as partial:
        partial.write_text("after")
        assert len(os.fsencode(partial.name)) <= 64
    assert names(tmp_path) == [name]
    assert (tmp_path / name).read_text() == "after"


def test_a_name_that_is_too_long_is_named(tmp_path):
    with pytest.raises(OSError, match=r"x{256}") as caught:
        write_whole(tmp_path / ("x" * 256), "text")
    assert caught.value.errno == errno.ENAMETOOLONG
    assert names(tmp_path) == []


@pytest.mark.parametrize("free", [True, False])
def test_a_folder_without_right_to_write_is_refused_by_the_name_of_the_file(anywhere, free):
    folder = anywhere / "folder"
    folder.mkdir()
    path = folder / "file"
    if not free:
        path.write_text("before")
        path.chmod(0o666)
    folder.chmod(0o555)
    with ordinary_user(), pytest.raises(PermissionError) as caught:
        write_whole(path, "after")
    folder.chmod(0o755)
    assert caught.value.filename == str(path)
    assert names(folder) == ([] if free else ["file"])
    assert free or path.read_text() == "before"


def test_a_write_protected_file_is_refused(anywhere):
    path = anywhere / "file"
    path.write_text("before")
    path.chmod(0o444)
    with ordinary_user(), pytest.raises(PermissionError, match="write-protected"):
        write_whole(path, "after")
    assert (path.read_text(), names(anywhere)) == ("before", ["file"])


def test_a_full_disk_leaves_what_was_there(tmp_path):
    path = tmp_path / "file"
    path.write_text("before")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError, match="file") as caught:
            write_whole(path, b"x" * 5000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (caught.value.errno, caught.value.filename) == (errno.EFBIG, str(path))
    assert (path.read_text(), names(tmp_path)) == ("before", ["file"])


def refusing(function, number, kind=None):
    """A system call that a file system does not have, or that fails, for folders or files only if told so."""
    calls = []

    def call(first, *given, **named):
        folder = stat.S_ISDIR(os.fstat(first).st_mode) if isinstance(first, int) else False
        if kind is None or (kind == "folder") == folder:
            calls.append(first)
            raise OSError(number, os.strerror(number))
        return function(first, *given, **named)

    return call, calls


NOT_THERE = [errno.EINVAL, errno.ENOTSUP, errno.EPERM, errno.ENOSYS]
BROKEN = [errno.EIO, errno.ENOSPC, errno.EDQUOT]


@pytest.mark.parametrize("number", NOT_THERE)
@pytest.mark.parametrize("kind", ["folder", "file"])
def test_a_file_system_without_fsync_is_written(tmp_path, monkeypatch, number, kind):
    call, calls = refusing(os.fsync, number, kind)
    monkeypatch.setattr(os, "fsync", call)
    write_whole(tmp_path / "file", "text")
    assert calls
    assert (tmp_path / "file").read_text() == "text"


@pytest.mark.parametrize("number", NOT_THERE)
def test_a_file_system_without_modes_and_owners_is_written(tmp_path, monkeypatch, number):
    path = tmp_path / "file"
    path.write_text("before")
    path.chmod(0o600)
    path.chmod(0o666)
    if ROOT:
        os.chown(path, 1234, 2345)
    chmod, changed = refusing(os.chmod, number)
    chown, given = refusing(os.chown, number)
    monkeypatch.setattr(os, "chmod", chmod)
    monkeypatch.setattr(os, "chown", chown)
    with umask(0o022):
        write_whole(path, "after")
    assert changed
    assert bool(given) == ROOT
    assert path.read_text() == "after"
    write_whole(tmp_path / "new", "text")
    assert names(tmp_path) == ["file", "new"]


@pytest.mark.parametrize("number", BROKEN)
@pytest.mark.parametrize("kind", ["folder", "file"])
def test_a_broken_disk_is_no_missing_feature(tmp_path, monkeypatch, number, kind):
    monkeypatch.setattr(os, "fsync", refusing(os.fsync, number, kind)[0])
    with pytest.raises(OSError, match="file") as caught:
        write_whole(tmp_path / "file", "text")
    assert (caught.value.errno, caught.value.filename) == (number, str(tmp_path / "file"))
    assert kind == "folder" or names(tmp_path) == []


@pytest.mark.parametrize("number", [*BROKEN, errno.EROFS])
def test_a_mode_that_cannot_be_kept_for_another_reason_is_an_error(tmp_path, monkeypatch, number):
    path = tmp_path / "file"
    path.write_text("before")
    path.chmod(0o666)
    monkeypatch.setattr(os, "chmod", refusing(os.chmod, number)[0])
    with umask(0o022), pytest.raises(OSError, match="file") as caught:
        write_whole(path, "after")
    assert caught.value.errno == number
    assert (path.read_text(), names(tmp_path)) == ("before", ["file"])


@pytest.mark.skipif(not ROOT, reason="only the superuser mounts")
def test_a_file_that_is_mounted_alone_is_written_in_place(tmp_path):
    outside, inside = tmp_path / "outside", tmp_path / "inside"
    outside.write_text("before, and longer")
    inside.touch()
    if subprocess.run(["mount", "--bind", outside, inside], capture_output=True).returncode:
        pytest.skip("nothing can be mounted here")
    try:
        write_whole(inside, "after")
        assert outside.read_text() == "after"
        assert names(tmp_path) == ["inside", "outside"]
    finally:
        subprocess.run(["umount", inside], check=True)


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError, OSError("no number"), ValueError])
@pytest.mark.parametrize("name", ["file", "fifo"])
def test_what_fails_half_way_leaves_what_was_there(tmp_path, error, name):
    (tmp_path / "file").write_text("before")
    os.mkfifo(tmp_path / "fifo")

    def half_way():
        with written(tmp_path / name) as partial:
            partial.write_text("half")
            raise error

    with pytest.raises(error if isinstance(error, type) else type(error)):
        half_way()
    assert names(tmp_path) == ["fifo", "file"]
    assert (tmp_path / "file").read_text() == "before"
