"""Where the project lies, and the data of its tests."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / 'test' / 'data'
