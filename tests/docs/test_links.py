"""The checker of the built site's links, which `make docs` runs, finds what is broken and nothing else."""

from tests.docs.links import broken


def test_a_missing_page_a_missing_heading_and_a_missing_picture_are_found(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "index.html").write_text(
        '<h1 id="top"></h1><a href="#top">a</a><a href="folder/">b</a><a href="https://example.org/x">c</a>'
        '<a href="folder/index.html#here">d</a><a href="folder/index.html#there">e</a>'
        '<a href="gone.html">f</a><img src="gone.png">',
        encoding="utf-8",
    )
    (tmp_path / "folder" / "index.html").write_text(
        '<p id="here"></p><a href="../index.html#top">a</a>', encoding="utf-8"
    )
    assert broken(tmp_path) == [
        "index.html: folder/index.html#there",
        "index.html: gone.html",
        "index.html: gone.png",
    ]
