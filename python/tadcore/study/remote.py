"""A store that is not in a file system: objects under a URL, such as ``s3://bucket/prefix``.

What Arrow opens by itself (S3, Google Cloud Storage, Azure) needs no other package; all else is fsspec's. An object
appears whole or not at all, since an upload that is not ended leaves none. There are no renames, so what is moved is
copied by the service and then deleted, and no locks: `tadcore.study.lease` says who writes.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
from collections.abc import Iterator, Mapping
from typing import Any
from urllib.parse import SplitResult, urlsplit

import pyarrow as pa
from pyarrow import fs

from tadcore.errors import ScenarioError, StoreError

from .lease import Lease, leased
from .place import Place, faults

_BUCKETS = {"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az"}
_opened: dict[tuple[str, str], tuple[fs.FileSystem, str]] = {}
_process: int | None = None


class Remote:
    """The objects under a URL; a `Place`.

    Parameters
    ----------
    url : str
        With what its service takes as a query, such as ``?region=eu-west-1``.
    options : mapping, optional
        Arguments of fsspec's file system, which then is used for every service.
    """

    threads = 8

    def __init__(self, url: str, options: Mapping[str, Any] | None = None) -> None:
        self._url, self._options = urlsplit(url), None if options is None else dict(options)
        self._lease: Lease | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_lease": None}  # who has it does so here

    def __str__(self) -> str:
        """The URL without credentials and options."""
        url = self._url
        return SplitResult(url.scheme, url.netloc.rpartition("@")[2], url.path, "", "").geturl().rstrip("/")

    def at(self, name: str) -> str:
        """The URL of an object."""
        return f"{self}/{name}"

    def absolute(self) -> Remote:
        """Itself."""
        return self

    def inside(self, name: str) -> Remote:
        """A longer prefix."""
        path = f"{self._url.path.rstrip('/')}/{name}"
        return Remote(self._url._replace(path=path).geturl(), self._options)

    def open(self, field: str) -> Remote:
        """Itself, if its service is known and its options fit; else raises `ScenarioError`."""
        try:
            self._try()
        except ImportError as error:
            rule = f"opened by what is installed ({error}): fsspec comes with pip install 'tadcore[cloud]'"
            raise ScenarioError(field, str(self), rule) from None
        except (ValueError, TypeError, OSError) as error:
            raise ScenarioError(field, str(self), f"a URL that Arrow or fsspec can open ({error})") from None
        return self

    def _try(self) -> None:
        """Open it, and ask something, since some packages see their options only then."""
        files, path = self._files()
        try:
            files.get_file_info(path)
        except (ImportError, ValueError, TypeError):
            raise
        except Exception:  # what the service refuses it refuses again, in the words of a store, when it is used
            return

    def names(self) -> list[str]:
        """The objects, and what begins longer prefixes."""
        with self._faults() as (files, path):
            found = files.get_file_info(fs.FileSelector(path, allow_not_found=True))
        return sorted(info.base_name for info in found)

    def exists(self, name: str) -> bool:
        """Whether there is such an object, or a prefix."""
        with self._faults(name) as (files, path):
            return bool(files.get_file_info(path).type != fs.FileType.NotFound)

    def strange(self, name: str) -> str | None:
        """Nothing but objects has names here."""
        return None

    def read(self, name: str, most: int) -> bytes:
        """The beginning of an object."""
        with _as_system(), self.source(name) as source:
            data: bytes = source.read(most)
        return data

    def source(self, name: str) -> pa.NativeFile:
        """An object to read from."""
        with _as_system():
            files, path = self._files()
            return files.open_input_file(f"{path}/{name}")

    def write(self, name: str, content: str | bytes | memoryview) -> None:
        """Put an object."""
        self._refuse_lost()
        data = content.encode("utf-8") if isinstance(content, str) else content
        with self._faults(name) as (files, path):
            stream = files.open_output_stream(path)
            stream.write(data)
            stream.close()  # here alone the object comes to be

    def remove(self, name: str) -> None:
        """Delete an object."""
        self._refuse_lost()
        with self._faults(name) as (files, path), contextlib.suppress(FileNotFoundError):
            files.delete_file(path)

    def take(self, name: str, other: Place) -> None:
        """Copy an object within the service, then delete it."""
        assert isinstance(other, Remote)  # as `inside` made it
        self._refuse_lost()
        with other._faults(name) as (files, path):
            files.move(path, f"{self._files()[1]}/{name}")

    def make(self) -> None:
        """See that the bucket is there, which nobody makes by a slip of the pen; what has no buckets gets a folder."""
        with self._faults() as (files, path):
            bucket = path.partition("/")[0]
            if self._url.scheme not in _BUCKETS:
                files.create_dir(path, recursive=True)
            elif files.get_file_info(bucket).type == fs.FileType.NotFound:
                raise OSError(errno.ENOENT, f"there is no bucket {bucket}")

    def discard(self) -> None:
        """Delete what stands for the empty prefix."""
        left = self.names()
        with self._faults() as (files, path), contextlib.suppress(FileNotFoundError):
            if left:
                raise OSError(errno.ENOTEMPTY, f"it still holds {', '.join(left[:3])}")
            files.delete_dir(path)

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Under a lease that is renewed while this run lives."""
        with leased(self) as self._lease:
            try:
                yield
            finally:
                self._lease = None

    def _refuse_lost(self) -> None:
        taker = None if self._lease is None else self._lease.lost
        if taker is not None:
            found = f"{taker} has taken it over, since nothing was heard of this run"
            raise StoreError(str(self), found, "wait for the end of that run: what was finished is there")

    @contextlib.contextmanager
    def _faults(self, name: str | None = None) -> Iterator[tuple[fs.FileSystem, str]]:
        """The file system and a path in it; what the service refuses, in the words of a store."""
        with faults(self if name is None else self.at(name)), _as_system():
            files, path = self._files()
            yield files, path if name is None else f"{path}/{name}"

    def _files(self) -> tuple[fs.FileSystem, str]:
        """The file system, opened once in a process, and the path of this place in it."""
        global _process
        if _process not in (None, os.getpid()):
            raise OSError(errno.ENOTSUP, "a forked process cannot use connections of the one that it comes from")
        key = (self._url.geturl(), json.dumps(self._options, sort_keys=True, default=repr))
        if key not in _opened:
            _process = os.getpid()
            _opened[key] = _open(self._url, self._options)
        files, path = _opened[key]
        cached = getattr(getattr(files, "handler", None), "fs", None)
        if cached is not None:
            cached.invalidate_cache()  # listings that fsspec remembers do not know what others write
        return files, path


@contextlib.contextmanager
def _as_system() -> Iterator[None]:
    """What the package of a service raises, as the operating system would."""
    try:
        yield
    except (OSError, StoreError):
        raise
    except Exception as error:
        raise OSError(errno.EIO, f"{type(error).__name__}: {error}") from error


def _open(url: SplitResult, options: dict[str, Any] | None) -> tuple[fs.FileSystem, str]:
    """Arrow's own file system, or fsspec's where there are options for it or Arrow has none."""
    if options is None:
        try:
            files, path = fs.FileSystem.from_uri(url.geturl())
        except pa.ArrowInvalid as error:
            if "Unrecognized filesystem type" not in str(error):
                raise
        else:
            return files, path.rstrip("/")
    from fsspec.core import url_to_fs

    files, path = url_to_fs(url._replace(query="", fragment="").geturl(), **(options or {}))
    return fs.PyFileSystem(fs.FSSpecHandler(files)), path.rstrip("/")
