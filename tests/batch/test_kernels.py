"""Where compiled code is kept."""

from attest.batch.kernels import cache_folder, compilation


def test_usual_places_are_used_if_one_of_them_takes_files(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    (tmp_path / "file").touch()
    closed = tmp_path / "file" / "below"
    assert cache_folder(tmp_path, (closed, tmp_path / "home")) is None
    assert cache_folder(tmp_path, (tmp_path, closed)) is None


def test_package_and_home_that_are_read_only_leave_the_output(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    (tmp_path / "file").touch()
    closed = tmp_path / "file" / "below"
    assert cache_folder(tmp_path, (closed, closed)) == str(tmp_path / ".kernels")


def test_a_place_that_the_user_names_is_taken(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert cache_folder(tmp_path, ()) is None


def test_without_room_for_a_flight_logs_compile_what_they_need(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "gone"))
    with compilation({}, ()) as compile_first:
        compile_first()
