"""The search of the built site: its own worker script, in a JavaScript engine."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from py_mini_racer import MiniRacer

BROWSER = """
var self = globalThis, answers = [], ask;
self.console = {warn: (text) => { throw new Error(text); }};
var handlers = [];
self.addEventListener = (kind, handler) => { handlers.push(handler); };
ask = (type, data) => { const event = {data: {type, data}}; handlers.forEach((each) => each(event)); };
self.postMessage = (message) => answers.push(message.data);
"""
"""The functions of a browser that the worker calls."""


class SiteSearch:
    """Searches a site as its pages do.

    Args:
        site: Folder of the built site.
    """

    def __init__(self, site: Path) -> None:
        (worker,) = site.glob("assets/javascripts/workers/search.*.min.js")
        index = json.loads((site / "search/search_index.json").read_text(encoding="utf-8"))
        self._engine = MiniRacer()
        self._engine.eval(BROWSER)
        self._engine.eval(worker.read_text(encoding="utf-8"))
        self._ask(0, {**index, "options": {"suggest": False}})

    def pages(self, words: str) -> list[str]:
        """Returns the pages that are found, best first, as paths in the site."""
        found = self._ask(2, words)["items"]
        return [group[0]["location"].partition("#")[0] for group in found]

    def _ask(self, kind: int, data: Any) -> Any:
        self._engine.eval(f"answers.length = 0; ask({kind}, {json.dumps(data)}); 0")
        return json.loads(self._engine.eval("JSON.stringify(answers.at(-1) ?? null)"))
