"""Draw the gallery of categories: python benchmarks/pictures/category_pictures.py [docs/categories].

CATEGORY.webp shows the typical specimen with its label's axes, CATEGORY_variants.webp six others. README.md
shows them with the facts of categories.csv, whose audit `benchmarks/grasp_audit.py` prints.
"""

from __future__ import annotations

import csv
import tempfile
from pathlib import Path

import joblib
import tyro
from PIL import Image

from manipose_mj.assets.catalogue import draft
from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.console.process import one_thread_per_process
from manipose_mj.mjcf.views.thumbnails import thumbnail

SIZE, SMALL, QUALITY = 200, 100, 82
VARIANTS = 6
TYPES = {
    "axial": "Axially symmetric",
    "mirror": "Mirror-symmetric",
    "functional": "Tools",
    "articulated": "Articulated",
}
SYMMETRIES = {"none": "no symmetry", "varies": "symmetry varies"}
HEAD = """# Categories

*Written by `python benchmarks/pictures/category_pictures.py`.*

3,036 objects in 59 categories need no download. The first picture shows the typical specimen, index 0; the strip shows six others. Axes: X red,
Y green, Z blue; see [Labels](../concepts/labels.md). Below each name: the [symmetry](../concepts/symmetry.md), the range of the longest
side, and the number of objects, all of which a Panda can hold ([audit](../experiments/grasp_audit.md)).

```sh
manipose assets list --category mug                  # names; also --type, --split, --graspable
manipose assets sheet --category mug --out sheets    # all of them on one picture
manipose assets stats                                # counts; --json for programs
```

Shapes, convex parts, masses, labels and areas are exact by construction, and the same index gives the same object on every machine. Indices that
leave 4 when divided by 5 form the test split. Sizes are those of products on sale; each generator's docstring names their source.

Symmetry means proper rotations that leave the shape unchanged. A chips can is the exception: its print tells its ends apart.
"""


def variants(category: str) -> tuple[int, ...]:
    """Indices of the specimens in the strip, spread over the category and without the typical one."""
    count = CATALOGUE[category].instances
    return tuple(1 + round(i * (count - 2) / (VARIANTS - 1)) for i in range(VARIANTS))


def page(facts: list[dict[str, str]]) -> str:
    """The gallery, from the rows of categories.csv."""
    sections = [HEAD]
    for kind, title in TYPES.items():
        sections.append(f'## {title}\n\n<div class="gallery" markdown>\n')
        for row in facts:
            if row["type"] == kind:
                sections.append(card(row))
        sections.append("</div>\n")
    return "\n".join(sections)


def card(row: dict[str, str]) -> str:
    """One category's entry."""
    name = row["category"].replace("_", " ")
    symmetry = SYMMETRIES.get(row["symmetry"], row["symmetry"])
    return (
        f"- ![{name}]({row['category']}.webp)\n\n"
        f"    **{name}**: {symmetry}, {row['shortest_mm']} - {row['longest_mm']} mm, {row['instances']}\n\n"
        f"    ![six other specimens]({row['category']}_variants.webp)\n"
    )


def facts(folder: Path) -> list[dict[str, str]]:
    """The rows of a folder's categories.csv."""
    with (folder / "categories.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def draw(category: str, out: Path) -> None:
    """Write both pictures of a category."""
    picture(category, 0, SIZE).save(out / f"{category}.webp", quality=QUALITY, method=6)
    strip = Image.new("RGB", (VARIANTS * SMALL, SMALL))
    for column, index in enumerate(variants(category)):
        strip.paste(picture(category, index, SMALL), (column * SMALL, 0))
    strip.save(out / f"{category}_variants.webp", quality=QUALITY, method=6)


def picture(category: str, index: int, size: int) -> Image.Image:
    """One built-in object with its label's axes, drawn by rays at twice the size and reduced."""
    with tempfile.TemporaryDirectory(prefix="manipose-gallery-") as folder:
        large = thumbnail(draft(category, index, Path(folder)), 2 * size, engine="ray")
    return large.resize((size, size), Image.Resampling.BOX)


def main(
    out: tyro.conf.Positional[Path] = Path("docs/categories"),
    only: tuple[str, ...] = (),
    jobs: int = 1,
) -> None:
    """Draw the pictures and write the page.

    Args:
      out: Their folder, which holds categories.csv.
      only: Categories to draw; all by default.
      jobs: Categories at the same time.
    """
    one_thread_per_process()
    out.mkdir(parents=True, exist_ok=True)
    joblib.Parallel(n_jobs=jobs)(joblib.delayed(draw)(name, out) for name in only or CATALOGUE)
    (out / "README.md").write_text(page(facts(out)), encoding="utf-8")


if __name__ == "__main__":
    tyro.cli(main)
