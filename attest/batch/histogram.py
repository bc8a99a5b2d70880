"""A distribution as a drawing in a page."""

from collections.abc import Sequence

import numpy as np

BINS = 40
WIDTH, HEIGHT, FOOT = 400, 120, 16


def histogram(values: Sequence[float]) -> str:
    """Return SVG with a bar for each range of values; what is far out is in the last one."""
    found = np.asarray(values, float)
    found = found[np.isfinite(found)]
    if not found.size:
        return ""
    most = float(np.percentile(found, 98)) or 1.0
    counts = np.histogram(found.clip(0.0, most), BINS, (0.0, most))[0]
    wide, tall = WIDTH / BINS, HEIGHT / counts.max()
    bars = "".join(
        f'<rect x="{i * wide:.1f}" y="{HEIGHT - n * tall:.1f}" width="{wide - 1:.1f}" '
        f'height="{n * tall:.1f}" fill="#47b"><title>{n}</title></rect>'
        for i, n in enumerate(counts.tolist())
        if n
    )
    median = float(np.median(found))
    at = min(median / most, 1.0) * WIDTH
    return (
        f'<svg width="{WIDTH}" height="{HEIGHT + FOOT}" role="img">{bars}'
        f'<line x1="{at:.1f}" x2="{at:.1f}" y1="0" y2="{HEIGHT}" stroke="#c33"/>'
        f'<text x="0" y="{HEIGHT + 12}">0°</text>'
        f'<text x="{WIDTH}" y="{HEIGHT + 12}" text-anchor="end">{most:.2f}° and more</text>'
        f'<text x="{WIDTH // 2}" y="{HEIGHT + 12}" text-anchor="middle">median {median:.2f}°</text>'
        "</svg>"
    )
