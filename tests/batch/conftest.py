"""An object store on this machine."""

import os
import threading
from dataclasses import dataclass
from uuid import uuid4

import pytest

KEYS = {
    "AWS_ACCESS_KEY_ID": "key",
    "AWS_SECRET_ACCESS_KEY": "secret",
    "AWS_DEFAULT_REGION": "us-east-1",
    "AWS_EC2_METADATA_DISABLED": "true",
}


@dataclass(frozen=True)
class Bucket:
    """A bucket of a test's own."""

    fs: object
    name: str

    def url(self, key=""):
        return f"s3://{self.name}/{key}"

    def put(self, key, data):
        self.fs.pipe_file(f"{self.name}/{key}", data)
        return self.url(key)

    def keys(self, below=""):
        return [key.removeprefix(f"{self.name}/") for key in self.fs.find(f"{self.name}/{below}")]

    def refuse(self, after="0"):
        """Let the server look at the keys that it is given, which it does not know."""
        import moto.settings

        moto.settings.INITIAL_NO_AUTH_ACTION_COUNT = float(after)


@pytest.fixture(scope="session")
def s3_server():
    """Serve S3; what it puts only if there is none, it does one at a time, as S3 does."""
    from moto.s3.responses import S3Response
    from moto.server import ThreadedMotoServer

    lock, put = threading.Lock(), S3Response.put_object

    def one_by_one(self):
        with lock:
            return put(self)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(S3Response, "put_object", one_by_one)
        server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
        server.start()
        host, port = server.get_host_and_port()
        yield f"http://{host}:{port}"
        server.stop()


@pytest.fixture
def bucket(s3_server, monkeypatch):
    """Give an empty bucket, and let this process and those that it starts find it."""
    import fsspec
    from s3fs import S3FileSystem

    for name, value in (KEYS | {"AWS_ENDPOINT_URL": s3_server}).items():
        monkeypatch.setenv(name, value)
    for name in [name for name in os.environ if name in {"AWS_PROFILE", "AWS_SESSION_TOKEN"}]:
        monkeypatch.delenv(name)
    S3FileSystem.clear_instance_cache()
    fs = fsspec.filesystem("s3", use_listings_cache=False)
    name = f"bucket-{uuid4().hex[:8]}"
    fs.mkdir(name)
    yield Bucket(fs, name)
    S3FileSystem.clear_instance_cache()
