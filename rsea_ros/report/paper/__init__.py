"""The paper recomputed: page, figures, tables, drawings, paper.json."""
