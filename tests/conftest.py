"""Settings that every test shares."""

import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings

# before any attest import: numba's disk cache does not notice a change in a function called from
# another file, so each session compiles afresh
os.environ["NUMBA_CACHE_DIR"] = tempfile.mkdtemp(prefix="attest-numba-")

settings.register_profile(
    "attest",
    deadline=None,  # a first call compiles
    max_examples=50,
    derandomize=os.environ.get("CI") == "true",  # new examples are for people, not for CI
)
settings.load_profile("attest")

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of recorded logs that are kept outside the project."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        if os.environ.get("CI") == "true":
            pytest.fail(f"{folder} is missing, and CI must run the tests on recorded logs")
        pytest.skip(f"{folder} is missing: these tests need the recorded logs")
    return folder


@pytest.fixture(scope="session")
def sample_logs() -> Path:
    """Folder of the logs that the project ships."""
    return ROOT / "sample_logs"
