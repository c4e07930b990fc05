from .app.report.html import (
    Picture as Picture,
)
from .app.report.html import (
    Report as Report,
)
from .app.report.html import (
    Section as Section,
)
from .app.report.html import (
    render_html as render_html,
)
from .base.results import (
    Table as Table,
)

__all__ = [
    "Picture",
    "Report",
    "Section",
    "Table",
    "render_html",
]
