"""The look of the reports of studies: the style sheet of a page of tables and charts."""

LOOK = """
body { font: 15px sans-serif; margin: clamp(12px, 3vw, 2em); color: #222; background: #fff; }
table { border-collapse: collapse; margin: 0 0 1em }
td, th { padding: 2px 10px 2px 0; text-align: left; vertical-align: top; overflow-wrap: anywhere }
th { overflow-wrap: normal; min-width: 6em }
svg { font: 12px sans-serif; margin: 4px 12px 4px 0; max-width: 100%; height: auto }
svg .title { font-weight: bold }
.box { fill: none; stroke: #bbb } .bar { fill: #3a75b0 } circle { fill: #3a75b0; opacity: .5 }
.wide { fill: #3a75b0; opacity: .2 } .narrow { fill: #3a75b0; opacity: .35 }
.scroll { overflow-x: auto }
.line { fill: none; stroke: #123; stroke-width: 1.5 }
"""
