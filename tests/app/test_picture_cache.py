"""Pictures are kept until they are too many or outdated."""

from gazeloc_app.drawing.picture_cache import PictureCache
from gazeloc_app.drawing.render_jobs import Frame

FIRST, SECOND, THIRD = (Frame(recording="walk", index=index) for index in range(3))


def test_the_ones_that_were_seen_last_are_kept():
    cache = PictureCache(max_bytes=10)
    cache.put(FIRST, b"1234", cache.revision)
    cache.put(SECOND, b"1234", cache.revision)
    assert cache.get(FIRST) == b"1234"
    cache.put(THIRD, b"1234", cache.revision)
    assert [cache.get(job) for job in (FIRST, SECOND, THIRD)] == [b"1234", None, b"1234"]


def test_what_was_begun_before_all_became_outdated_is_not_kept():
    cache = PictureCache(max_bytes=100)
    cache.put(FIRST, b"grey", cache.revision)
    begun = cache.revision
    cache.clear()
    cache.put(SECOND, b"grey", begun)
    cache.put(THIRD, b"coloured", cache.revision)
    assert [cache.get(job) for job in (FIRST, SECOND, THIRD)] == [None, None, b"coloured"]


def test_only_pictures_are_kept():
    cache = PictureCache(max_bytes=100)
    cache.put(FIRST, None, cache.revision)
    assert cache.get(FIRST) is None
