"""What a notebook shows, in the light and in the dark: a browser computes the contrast of every text."""

import json
import os
import re
import subprocess

import mirrorstats as ms
import pytest

# The colours of JupyterLab's themes, and how it stripes the rows of tables.
THEMES = {
    "light": {"text": "rgba(0, 0, 0, 0.87)", "page": "white", "stripe": "#f5f5f5"},
    "dark": {"text": "rgba(255, 255, 255, 0.87)", "page": "#111111", "stripe": "#212121"},
}
PAGE = """<!doctype html><meta charset="utf-8"><style>
body {{ color: {text}; background: {page} }} tr:nth-child(odd) {{ background: {stripe} }}
</style>{shown}<script>
const parts = color => color.match(/[\\d.]+/g).map(Number);
const over = (top, below) => top.slice(0, 3).map((c, i) => c * (top[3] ?? 1) + below[i] * (1 - (top[3] ?? 1)));
const below = element => {{
  const own = parts(getComputedStyle(element).backgroundColor);
  return element.parentElement ? over(own, below(element.parentElement)) : over(own, [255, 255, 255]);
}};
const light = color => {{
  const [r, g, b] = color.map(c => c / 255).map(c => c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}};
const contrasts = [...document.querySelectorAll("caption, th, td, pre, caption *, td *")].map(element => {{
  const paper = below(element);
  const pair = [light(over(parts(getComputedStyle(element).color), paper)), light(paper)].sort((a, b) => b - a);
  return [element.tagName, (pair[0] + 0.05) / (pair[1] + 0.05)];
}});
const wide = [...document.querySelectorAll("pre")].map(element => {{
  const style = getComputedStyle(element);
  return [style.fontFamily, style.overflowX];
}});
document.body.textContent = JSON.stringify({{contrasts, wide}});
</script>"""


@pytest.mark.parametrize("theme", THEMES)
def test_tables_and_text_are_read_in_the_light_and_in_the_dark(theme, paper, tmp_path):
    study = ms.open(paper)
    parts = [study.table(style="paper"), study.cells, study.episodes, study.stats()]
    page = tmp_path / "page.html"
    page.write_text(PAGE.format(shown="".join(part._repr_html_() for part in parts), **THEMES[theme]))
    words = ["--headless", "--no-sandbox", "--disable-gpu", "--window-size=500,800", "--dump-dom", page.as_uri()]
    profile = f"--user-data-dir={tmp_path / 'profile'}"
    ended = subprocess.run([os.environ["MIRRORSTATS_TEST_BROWSER"], profile, *words], capture_output=True, text=True, timeout=60)
    found = json.loads(re.search(r"<body>(\{.*\})\s*</body>", ended.stdout, re.DOTALL)[1])
    assert len(found["contrasts"]) > 500 and {name for name, _ in found["contrasts"]} >= {"CAPTION", "TH", "TD", "PRE", "B"}
    assert min(contrast for _, contrast in found["contrasts"]) >= 7
    assert found["wide"] == [["monospace", "auto"]]
