"""An SFTP server on this machine, as simple as OpenSSH's is to its clients."""

import os
import socket
import threading
from contextlib import contextmanager, suppress
from pathlib import Path

import paramiko

PASSWORD = "open"  # noqa: S105


class _Door(paramiko.ServerInterface):
    def check_auth_password(self, username, password):  # noqa: ARG002
        good = password == PASSWORD
        return paramiko.AUTH_SUCCESSFUL if good else paramiko.AUTH_FAILED

    def get_allowed_auths(self, username):  # noqa: ARG002
        return "password"

    def check_channel_request(self, kind, chanid):  # noqa: ARG002
        return paramiko.OPEN_SUCCEEDED


def _told(do):
    """Answer as the protocol does, where the system raises."""

    def method(*arguments):
        try:
            return do(*arguments)
        except OSError as error:
            return paramiko.SFTPServer.convert_errno(error.errno)

    return method


def _done(do):
    def method(*arguments):
        do(*arguments)
        return paramiko.SFTP_OK

    return _told(method)


def _open(_, path, flags, attributes):  # noqa: ARG001
    file = os.fdopen(os.open(path, flags, 0o600), "r+b" if flags & 3 else "rb", buffering=0)
    handle = paramiko.SFTPHandle(flags)
    handle.readfile = handle.writefile = file
    handle.stat = lambda: paramiko.SFTPAttributes.from_stat(os.fstat(file.fileno()))
    return handle


def _list(_, path):
    found = []
    with os.scandir(path) as entries:
        for entry in entries:
            with suppress(FileNotFoundError):  # gone since
                found.append(paramiko.SFTPAttributes.from_stat(entry.stat(), entry.name))
    return found


def _rename(_, old, new):
    os.link(old, new)  # as OpenSSH does: it replaces nothing
    Path(old).unlink()


class _Files(paramiko.SFTPServerInterface):
    open = _told(_open)
    list_folder = _told(_list)
    stat = lstat = _told(lambda _, path: paramiko.SFTPAttributes.from_stat(Path(path).stat()))
    remove = _done(lambda _, path: Path(path).unlink())
    rmdir = _done(lambda _, path: Path(path).rmdir())
    mkdir = _done(lambda _, path, __: Path(path).mkdir())
    rename = _done(_rename)
    posix_rename = _done(lambda _, old, new: Path(old).replace(new))


@contextmanager
def serving():
    """Serve the files of this machine to who knows the password; yield the port."""
    key = paramiko.RSAKey.generate(1024)
    listener = socket.create_server(("127.0.0.1", 0))
    transports = []

    def accept():
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            transport = paramiko.Transport(connection)
            transports.append(transport)
            transport.add_server_key(key)
            transport.set_subsystem_handler("sftp", paramiko.SFTPServer, _Files)
            transport.start_server(event=threading.Event(), server=_Door())

    thread = threading.Thread(target=accept, daemon=True)
    thread.start()
    try:
        yield listener.getsockname()[1]
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()
        thread.join()
        for transport in transports:
            transport.close()
