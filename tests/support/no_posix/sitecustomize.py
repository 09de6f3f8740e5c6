"""A Python as on Windows, as far as Linux can be that: on PYTHONPATH, its processes have it, too.

Modules and functions that Windows lacks are not there, but for those that the standard library of
Linux, filelock and pytest ask for, SIGKILL and the numbers of users: mypy for win32 finds these. An
open file can be neither removed nor replaced.
"""

import ctypes
import errno
import mmap
import multiprocessing.connection
import multiprocessing.popen_spawn_posix
import multiprocessing.resource_tracker
import multiprocessing.util
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import asyncio  # isort: skip
import filelock  # isort: skip  # which is written for both
import platformdirs  # isort: skip

MODULES = {"fcntl", "resource", "termios", "tty", "pty", "pwd", "grp", "syslog", "posix"}

FUNCTIONS = {
    os: (
        "fork", "forkpty", "killpg", "setsid", "getsid", "setpgid", "getpgid",
        "getegid", "getgid", "getgroups", "chown", "mkfifo", "mknod",
        "register_at_fork", "wait", "wait3", "wait4", "waitid", "statvfs", "getloadavg", "nice",
        "sched_getaffinity", "sched_setaffinity", "sched_getscheduler", "sched_setscheduler",
        "sched_getparam", "sched_param", "SCHED_FIFO", "SCHED_OTHER", "SCHED_RR", "sched_yield",
        "set_blocking", "O_ASYNC", "O_DIRECTORY", "O_NOFOLLOW", "O_CLOEXEC",
        "RTLD_NOLOAD", "RTLD_NOW", "RTLD_GLOBAL", "RTLD_LOCAL", "RTLD_LAZY", "ST_NOEXEC",
        "memfd_create", "pread", "pwrite", "preadv", "pwritev", "posix_fallocate",
    ),
    signal: (
        "SIGHUP", "SIGQUIT", "SIGPIPE", "SIGALRM", "SIGCHLD", "SIGIO", "SIGUSR1",
        "SIGUSR2", "SIGSTOP", "SIGCONT", "pthread_sigmask", "pthread_kill", "sigwait", "alarm",
        "setitimer", "siginterrupt", "SIG_BLOCK", "SIG_UNBLOCK", "SIG_SETMASK",
    ),
    select: ("poll", "epoll"),
    socket: ("AF_UNIX", "SO_REUSEPORT", "send_fds", "recv_fds"),
    mmap: ("MAP_PRIVATE", "MAP_ANONYMOUS", "MAP_SHARED", "PROT_READ", "PROT_WRITE"),
}  # fmt: skip

del asyncio, shutil, subprocess, tempfile, filelock, platformdirs


class Hidden:
    """Finds nothing in the place of what Windows lacks."""

    def find_spec(self, name, *_):
        if name in MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def is_open(path):
    """Whether a file is open in this process, but for locks, which would be removed there."""
    try:
        place = Path(path).lstat()
        numbers = [int(entry.name) for entry in Path("/proc/self/fd").iterdir()]
    except (OSError, TypeError):
        return False
    for number in numbers:
        try:
            found = os.fstat(number)
        except OSError:
            continue
        if (found.st_dev, found.st_ino) == (place.st_dev, place.st_ino):
            return not os.fsdecode(path).endswith(".lock") and Path(path).is_file()
    return False


def refusing(call):
    """A function that does nothing to an open file."""

    def refused(*paths, **options):
        for path in paths:
            if not any(options.values()) and is_open(path):
                raise PermissionError(errno.EACCES, "the file is open", path)
        return call(*paths, **options)

    return refused


def without_none(library):
    """A class of libraries of which none is the whole process."""

    class Named(library):
        def __init__(self, name, *arguments, **options):
            if name is None:
                raise TypeError("bad argument type for built-in operation")
            super().__init__(name, *arguments, **options)

    return Named


socket.socketpair = partial(socket.socketpair, socket.AF_UNIX)  # there of another family
multiprocessing.resource_tracker._HAVE_SIGMASK = False
for module in MODULES:
    sys.modules.pop(module, None)
sys.meta_path.insert(0, Hidden())
for place, names in FUNCTIONS.items():
    for name in names:
        if hasattr(place, name):
            delattr(place, name)
for name in ("rename", "replace", "unlink", "remove"):
    setattr(os, name, refusing(getattr(os, name)))
ctypes.CDLL = without_none(ctypes.CDLL)
