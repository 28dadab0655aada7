"""Parts of the site that mkdocs.yml cannot describe: pages from this folder, files that pages link to, llms.txt."""

from __future__ import annotations

import json
import logging
import re
import tempfile
from pathlib import Path
from typing import Any

from mkdocs.plugins import event_priority
from mkdocs.structure.files import File, Files
from mkdocs.structure.nav import Navigation, Section
from mkdocs.structure.pages import Page
from pymdownx.slugs import slugify

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
LINK_OUT = re.compile(r"\]\(\.\./((?:src|tests|dev)/[^)\s#]+)\)")
"""A link to a file of the repository outside docs."""
FILE_AS_TEXT = re.compile(r"\[`?(\w+\.md)`?\]\(")
"""A link whose text is the file name of a page."""
MARK = re.compile(r"^ *<!-- .* -->\n(?= *```)", re.MULTILINE)
"""A comment before a block, for the tests; MkDocs would end a list with it."""
PICTURE = re.compile(r'<p>((?:<a [^>]*>)?<img alt="([^"]+)"[^>]*>(?:</a>)?)</p>')
"""A picture that is alone in its paragraph."""
CELL = re.compile(r"<td[^>]*>.*?</td>")
SHORT_CODE = re.compile(r"<code>([^<]{1,30})</code>")
"""A name in a cell of a table, which the style keeps on one line."""

BOOSTS = {"title": 10.0, "tags": 1.0}
"""Weights of a word in a title and in `extra.search.words`, compared with the text. With the theme's 1000 and
1,000,000, one word of a question decides alone. Whole phrases of `extra.search.words` count in `query.js`.
"""
OVERVIEW = re.compile(r"overview/(\w+)/index\.md")
"""A page that lists all pages of its tab."""
slug = slugify(case="lower")  # the anchors that mkdocs.yml sets
LOG = logging.getLogger("mkdocs.hooks.site")
MIRROR = tempfile.TemporaryDirectory(prefix="site-api-")


@event_priority(50)  # before mkdocstrings reads it
def on_config(config: Any) -> Any:
    """Lets mkdocstrings read the packages in a mirror in which each folder has an `__init__.py`, as it requires."""
    mirror = Path(MIRROR.name)
    for source in ROOT.glob("src/*/src"):
        for path in source.rglob("*.py"):
            link = mirror / path.relative_to(source)
            link.parent.mkdir(parents=True, exist_ok=True)
            link.exists() or link.symlink_to(path)
    for folder in mirror.rglob("*/"):
        (folder / "__init__.py").exists() or (folder / "__init__.py").touch()
    config.plugins["mkdocstrings"].config.handlers["python"]["paths"] = [str(mirror)]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Adds the pages and the style of this folder, and the files outside docs that pages link to."""
    pages = [file.abs_src_path for file in files.documentation_pages()]
    linked = {path for page in pages if page for path in LINK_OUT.findall(Path(page).read_text(encoding="utf-8"))}
    added = {f"api/{path.name}": path for path in sorted(HERE.glob("api/*.md"))}
    added |= {name: HERE / name for name in ("site.css", "iframe-worker.js")}
    added |= {f"files/{path}": ROOT / path for path in sorted(linked)}
    for uri, path in added.items():
        files.append(File.generated(config, uri, abs_src_path=str(path)))
    for uri in sorted(set(OVERVIEW.findall(json.dumps(config.nav)))):
        files.append(File.generated(config, f"overview/{uri}/index.md", content=""))
    return files


def on_page_markdown(markdown: str, page: Page, config: Any, files: Files) -> str:
    """Applies `extra.search` and `extra.reference`, replaces parts of links, and removes the marks of blocks."""
    if page.file.src_uri == "index.md":
        page.meta["hide"] = ["toc"]  # cards need the space; front matter would be seen on repository hosts
    if OVERVIEW.fullmatch(page.file.src_uri):
        return overview(page, config)
    search = config.extra["search"]
    page.meta["search"] = {"boost": search["boost"].get(page.file.src_uri, 1)}
    page.meta["tags"] = search["words"].get(page.file.src_uri, [])
    named = FILE_AS_TEXT.sub(lambda match: f"[{heading(config, match[1])}](", MARK.sub("", markdown))
    linked = LINK_OUT.sub(r"](files/\1)", named)
    if targets := config.extra["reference"].get(page.file.src_uri):
        links = " · ".join(f"[{title_of(config, target)}]({target})" for target in targets)
        linked += f"\n\n---\n\n**Reference:** {links}\n"
    return linked


def on_page_content(html: str, page: Page, config: Any, files: Files) -> str:
    """Shows the alternative text of a picture as its caption, and marks short code in tables."""
    html = PICTURE.sub(r"<figure>\1<figcaption>\2</figcaption></figure>", html)
    return CELL.sub(lambda cell: SHORT_CODE.sub(r'<code class="short">\1</code>', cell[0]), html)


def overview(page: Page, config: Any) -> str:
    """Returns a page that lists the pages of its tab with their first sentences."""
    page.meta["search"] = {"exclude": True}
    (tab,) = (each for each in config.extra["nav"].items if isinstance(each, Section) and page in each.children)
    lines = [f"# {tab.title}", ""]
    for child in tab.children:
        if isinstance(child, Section):
            lines += ["", f"## {child.title}", ""]
        for each in pages_of(child):
            if each is not page:
                path = source(config, each.file.src_uri)
                title = heading(config, each.file.src_uri)
                lines.append(
                    f"- [{title}](../../{each.file.src_uri}): {first_sentence(path.read_text(encoding='utf-8'))}"
                )
    return "\n".join(lines) + "\n"


def title_of(config: Any, target: str) -> str:
    """Returns the text of a link to a page of the reference, or to one of its sections."""
    page, _, section = target.partition("#")
    title = heading(config, page).replace("YAML reference", "YAML")
    if not section:
        return title
    names = re.findall(r"^#+ (.*)", source(config, page).read_text(encoding="utf-8"), re.MULTILINE)
    name = next((each for each in names if slug(each, "-") == section), section)
    return f"{title}: {name}" if page != "commands.md" else f"`./rpbi {name}`"


def source(config: Any, name: str) -> Path:
    """Returns the file of a page, of docs or of this folder."""
    path = Path(config.docs_dir, name)
    return path if path.exists() else HERE / name


def heading(config: Any, name: str) -> str:
    """Returns the first heading of a page, or its file name if the page is not there."""
    path = source(config, name)
    found = re.search(r"^# (.*)", path.read_text(encoding="utf-8"), re.MULTILINE) if path.exists() else None
    return found[1] if found else name


def on_env(env: Any, config: Any, files: Files) -> None:
    """Refuses words and ranks for the search of pages that are not there."""
    known = {file.src_uri for file in files.documentation_pages()}
    search, reference = config.extra["search"], config.extra["reference"]
    for key, named in (("search", {uri for pages in search.values() for uri in pages}), ("reference", {*reference})):
        for uri in sorted(named - known):
            LOG.warning("mkdocs.yml: extra.%s names %s, which is not there", key, uri)


def on_nav(nav: Navigation, config: Any, files: Files) -> None:
    """Keeps the navigation for llms.txt; titles and texts of its pages are not read yet."""
    config.extra["nav"] = nav


def on_post_build(config: Any) -> None:
    """Writes llms.txt from the navigation, and the pages' Markdown, to which it leads; adapts the search."""
    site = Path(config.site_dir)
    lines = [f"# {config.site_name}", "", f"> {config.site_description}.", ""]
    for section in config.extra["nav"].items:
        pages = [page for page in pages_of(section) if not OVERVIEW.fullmatch(page.file.src_uri)]
        lines += [f"## {section.title}", "", *map(entry, pages), ""]
        for page in pages:
            (site / page.file.src_uri).write_text(page.markdown, encoding="utf-8")
    (site / "llms.txt").write_text("\n".join(lines), encoding="utf-8")
    path = site / "search/search_index.json"
    index = json.loads(path.read_text(encoding="utf-8"))
    for field, boost in BOOSTS.items():
        index["config"]["fields"][field]["boost"] = boost
    path.write_text(json.dumps(index), encoding="utf-8")
    (worker,) = site.glob("assets/javascripts/workers/search.*.min.js")
    words = config.extra["search"]["words"]
    pages = {
        page.file.dest_uri: {"title": page.title, "phrases": list(map(str, words.get(page.file.src_uri, [])))}
        for section in config.extra["nav"].items
        for page in pages_of(section)
    }
    query = f"const PAGES = {json.dumps(pages)}\n{(HERE / 'query.js').read_text(encoding='utf-8')}"
    worker.write_text(query + worker.read_text(encoding="utf-8"), encoding="utf-8")


def pages_of(item: Any) -> list[Page]:
    """Returns the pages of a part of the navigation, in their order."""
    if isinstance(item, Section):
        return [page for child in item.children for page in pages_of(child)]
    return [item] if isinstance(item, Page) else []


def entry(page: Page) -> str:
    """Returns the line of a page in llms.txt: its title, its Markdown and its first paragraph."""
    return f"- [{page.title}]({page.file.src_uri}): {first_paragraph(page.markdown)}"


def first_paragraph(markdown: str) -> str:
    """Returns the first paragraph of a page in one line, without links."""
    text = re.sub(r"```.*?```|<!--.*?-->|^[#|!].*?$", "", markdown, flags=re.DOTALL | re.MULTILINE).strip()
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", " ".join(text.partition("\n\n")[0].split()))


def first_sentence(markdown: str) -> str:
    """Returns the first sentence of a page, without links."""
    return re.split(r"(?<=[.:?])\s", first_paragraph(markdown))[0].rstrip(":")
