"""Adds the files of the repository that pages link to, so that the book is whole without the repository."""

import os
import re

from mkdocs.structure.files import File

LINK = re.compile(r"(\]\()((?:\.\./)+[^)#\s]*)")


def on_files(files, config):
    """Adds linked files outside of `docs` below `repository/`; a folder becomes a page with its files."""
    root = os.path.dirname(config.config_file_path)
    for page in list(files.documentation_pages()):
        for _, link in LINK.findall(page.content_string):
            target = outside(page.src_uri, link)
            if target is None or files.get_file_from_path(named(root, target)):
                continue
            path = os.path.join(root, target)
            if os.path.isdir(path):
                listed = "".join(f"- `{name}`\n" for name in sorted(os.listdir(path)))
                files.append(File.generated(config, named(root, target), content=f"# {target}\n\n{listed}"))
            elif target.endswith(".md"):
                with open(path, encoding="utf-8") as file:
                    text = re.sub(r"\[([^]]*)\]\((?!https?:)[^)]*\)", r"\1", file.read())
                files.append(File.generated(config, named(root, target), content=text))
            elif os.path.exists(path):
                files.append(File.generated(config, named(root, target), abs_src_path=path))
    return files


def on_page_markdown(markdown, page, config, files):
    root = os.path.dirname(config.config_file_path)
    if page.file.src_uri.startswith("repository/"):
        return markdown

    def inside(match):
        target = outside(page.file.src_uri, match.group(2))
        if target is None:
            return match.group(0)
        return match.group(1) + os.path.relpath(named(root, target), os.path.dirname(page.file.src_uri) or ".")

    return LINK.sub(inside, markdown)


def outside(page, link):
    """The path in the repository of a link that leaves `docs`."""
    target = os.path.normpath(os.path.join("docs", os.path.dirname(page), link))
    return None if target.split(os.sep)[0] == "docs" else target


def named(root, target):
    is_folder = os.path.isdir(os.path.join(root, target))
    return f"repository/{target}" + ("/index.md" if is_folder else "")
