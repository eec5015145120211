#!/usr/bin/python3
"""Draws where each method holds, degrades and fails.

usage: draw_stability.py STABILITY_MAP.csv FIGURE.png

Reads what the program stability_map prints: one row a cell, with the columns map (the name of the
column that varies along y), method, speed_time_step_per_radius (along x) and verdict.
"""
import collections
import sys

import figure_style as style
from figure_style import plt

X = 'speed_time_step_per_radius'
# Light to dark as it gets worse, and a sign each, so that no colour has to be told from another.
VERDICTS = {'holds': ('#cfe3f3', ''), 'degrades': ('#f0b64d', '○'), 'fails': ('#a83232', '×')}
SIGN_COLOURS = {'degrades': '#5a3a00', 'fails': 'white'}
BOUNDS = ('Small gases in a periodic box. Holds: energy within 0.01, overlap within 0.05 radii, '
          'impacts within 0.05; degrades: within 0.1, 0.5 and 0.2; fails: beyond. What\ndoes not vary is at '
          'packing fraction 0.2, restitution 1, mass ratio 1. Source: bench/stability_map.cpp.')
NAMES = {'packing_fraction': 'packing fraction', 'restitution': 'restitution',
         'mass_ratio': 'mass ratio'}


def level(text):
    return '%g' % float(text)


def draw_map(axes, rows, quantity, columns, levels):
    """One square a row of the data, at the places of its values among all."""
    for row in rows:
        x = columns.index(float(row[X]))
        y = levels.index(float(row[quantity]))
        colour, sign = VERDICTS[row['verdict']]
        axes.add_patch(plt.Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=colour,
                                     edgecolor='white', linewidth=1))
        axes.text(x, y, sign, ha='center', va='center', fontsize=8,
                  color=SIGN_COLOURS.get(row['verdict'], 'black'))
    axes.set_xlim(-0.5, len(columns) - 0.5)
    axes.set_ylim(-0.5, len(levels) - 0.5)
    axes.set_xticks(range(0, len(columns), 2))
    axes.set_xticklabels([level(c) for c in columns[::2]])
    axes.set_yticks(range(len(levels)))
    first = axes.get_subplotspec().is_first_col()
    axes.set_yticklabels([level(v) for v in levels] if first else [])
    axes.grid(False)
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)


def draw(rows, path):
    maps = list(collections.OrderedDict((row['map'], 0) for row in rows))
    methods = sorted({row['method'] for row in rows}, key=style.order)
    columns = sorted({float(row[X]) for row in rows})
    figure, panels = plt.subplots(len(maps), len(methods), squeeze=False, sharex=True,
                                  figsize=(2.1 + 2.2 * len(methods), 1.4 + 2.0 * len(maps)))
    for line, quantity in zip(panels, maps):
        of_map = [row for row in rows if row['map'] == quantity]
        levels = sorted({float(row[quantity]) for row in of_map})
        for axes, method in zip(line, methods):
            draw_map(axes, [row for row in of_map if row['method'] == method], quantity, columns,
                     levels)
        line[0].set_ylabel(NAMES.get(quantity, quantity))
    for axes, method in zip(panels[0], methods):
        axes.set_title(method)
    handles = [plt.Rectangle((0, 0), 1, 1, facecolor=colour, label=(name + ' ' + sign).strip())
               for name, (colour, sign) in VERDICTS.items()]
    height = figure.get_size_inches()[1]
    figure.suptitle('Where each method holds, degrades and fails', x=0.01, ha='left', fontsize=12,
                    fontweight='bold')
    figure.text(0.5, 0.45 / height, 'way of a ball in one time step / its radius', ha='center')
    figure.legend(handles=handles, loc='lower right', ncol=3, frameon=False,
                  bbox_to_anchor=(0.99, 1 - 0.45 / height))
    figure.text(0.01, 0.08 / height, BOUNDS, fontsize=7.5, color='#404040')
    figure.subplots_adjust(left=0.08, right=0.99, top=1 - 0.75 / height, bottom=0.85 / height,
                           wspace=0.06, hspace=0.12)
    style.save(figure, path)


def main():
    data, path = sys.argv[1:3]
    draw(style.read(data), path)


if __name__ == '__main__':
    main()
