"""Files that nobody vouches for: how they are opened, how large they may be, what text may hold.

And what is said when a disk refuses to take a result.
"""

from robustpolish.files.archive import members
from robustpolish.files.disk import is_refusal, refusal, tells_of_disk, told_of_disk
from robustpolish.files.given import Wanted, content, opened, size_of, text
from robustpolish.files.tree import check_tree

__all__ = [
    "Wanted",
    "check_tree",
    "content",
    "is_refusal",
    "members",
    "opened",
    "refusal",
    "size_of",
    "tells_of_disk",
    "text",
    "told_of_disk",
]
