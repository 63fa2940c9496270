"""The theme's controls that fold the navigation get a name, which screen readers say."""

from typing import Any

from sphinx.application import Sphinx

NAMED = '<summary aria-label="Show or hide the pages below">'


def _name(app: Sphinx, page: str, template: str, context: dict[str, Any], tree: object) -> None:
    make = context["generate_toctree_html"]  # the theme's, called by its template

    def named(*arguments: Any, **options: Any) -> str:
        return str(make(*arguments, **options)).replace("<summary>", NAMED)

    context["generate_toctree_html"] = named


def setup(app: Sphinx) -> dict[str, bool]:
    """Act after the theme has put its function into the context."""
    app.connect("html-page-context", _name, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
