import pytest


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    """Results of statements are kept for these tests alone, not in the user's cache."""
    folder = tmp_path_factory.getbasetemp() / "statements"
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
