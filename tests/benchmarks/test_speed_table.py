"""The page of speed is what the command writes."""

from speed_table import COLUMNS, PAGE, page, read, write


def test_the_page_is_that_of_the_record():
    assert PAGE.read_text(encoding="utf-8") == page(read())


def test_a_row_takes_the_place_of_the_one_with_its_name(tmp_path):
    record = tmp_path / "speed.csv"
    row = ["cut", "a pass", "10", "2.00", "3", "0.9"]
    write({"cut, 10": row, "step, 10": ["step", *row[1:]]}, record)
    write({"cut, 10": [*row[:3], "1.00", *row[4:]]}, record)
    assert [found[3] for found in read(record).values()] == ["1.00", "2.00"]
    table = record.with_suffix(".md").read_text(encoding="utf-8").splitlines()[-4:]
    assert table[0] == "| " + " | ".join(COLUMNS) + " |"
    assert table[2] == "| cut | a pass | 10 | 1.00 | 3 | 0.9 |"
