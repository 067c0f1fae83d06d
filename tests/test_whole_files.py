"""A file is whole or not there, whatever ends its writing; what was there before stays."""

import pytest

from verify.errors import InputError
from verify.whole_files import asked_place, whole_file, write_whole


@pytest.mark.parametrize("end", [OSError, ValueError, KeyboardInterrupt])
def test_what_was_there_stays_if_writing_does_not_end(tmp_path, end):
    write_whole(tmp_path / "a.txt", "old")

    def begin():
        with whole_file(tmp_path / "a.txt") as partial:
            partial.write_text("ne")
            raise end

    with pytest.raises(end):
        begin()
    assert [file.read_text() for file in tmp_path.iterdir()] == ["old"]


def test_the_name_in_an_error_is_that_of_the_file_asked_for(tmp_path):
    (tmp_path / "folder").mkdir()
    for place in (tmp_path / "absent/a.txt", tmp_path / "folder"):
        with pytest.raises(OSError, match=f"'{place}'$"):
            write_whole(place, "a")
        with pytest.raises(InputError, match=f"^{place}: cannot be written"), asked_place(place):
            write_whole(place, "a")
    # what another file is to blame for keeps that file's name
    with pytest.raises(FileNotFoundError, match=r"other\.txt'$"), whole_file(tmp_path / "a.txt"):
        (tmp_path / "other.txt").read_text()
