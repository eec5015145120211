#!/usr/bin/python3
"""Draws what a collision costs as the number of balls grows.

usage: draw_scaling.py SCALING.csv FIGURE.png

Reads what ball_sim_scaling writes: method, packing_fraction, balls, ns_per_collision,
bytes_per_ball, rate_over_enskog.
"""
import collections
import sys

import figure_style as style
from figure_style import plt, value

# Of the methods the sign, of the packing fractions the shade.
SHADES = ['#9ecae1', '#4292c6', '#08306b']


def draw(rows, path):
    methods = sorted({row['method'] for row in rows}, key=style.order)
    fractions = sorted({row['packing_fraction'] for row in rows}, key=float)
    figure, (costs, rates) = plt.subplots(1, 2, figsize=(9.5, 4.3))
    groups = collections.OrderedDict()
    for row in rows:
        groups.setdefault((row['method'], row['packing_fraction']), []).append(row)
    for (method, fraction), some in groups.items():
        some = sorted(some, key=lambda row: float(row['balls']))
        look = dict(color=SHADES[fractions.index(fraction) % len(SHADES)],
                    marker=style.look(method)[1], markersize=8 if method == 'event_driven' else 5,
                    linestyle='-' if method == 'event_driven' else ':',
                    label='%s, packing fraction %s' % (method, fraction))
        balls = [value(row, 'balls') for row in some]
        costs.plot(balls, [value(row, 'ns_per_collision') / 1000 for row in some], **look)
        rates.plot(balls, [1e3 / value(row, 'ns_per_collision') for row in some], **look)
    costs.set_title('What one collision costs')
    costs.set_ylabel('CPU time per ball-ball collision, µs')
    rates.set_title('How many happen in a second')
    rates.set_ylabel('million collisions per CPU second')
    for axes in (costs, rates):
        axes.set_xscale('log')
        axes.set_xlabel('number of balls')
        axes.set_ylim(bottom=0)
    figure.legend(*costs.get_legend_handles_labels(), loc='lower center', frameon=False,
                  ncol=min(3, len(groups)) if len(methods) == 1 else 3)
    lines = (len(groups) + 2) // 3
    figure.suptitle('Cost of exactness as the number of balls grows', x=0.01, ha='left',
                    fontsize=12, fontweight='bold')
    figure.subplots_adjust(left=0.07, right=0.99, top=0.85, bottom=0.16 + 0.055 * lines,
                           wspace=0.2)
    style.save(figure, path)


def main():
    data, path = sys.argv[1:3]
    draw(style.read(data), path)


if __name__ == '__main__':
    main()
