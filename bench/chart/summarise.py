#!/usr/bin/python3
"""Makes one row a (scene, entrant, step) of the runs that ball_sim_chart wrote.

usage: summarise.py RUNS.csv SUMMARY.csv

Medians and quartiles are over the runs that did not fail; `failed` says how many did, and
`failure` what most of them died of.
"""
import collections
import csv
import statistics
import sys

QUARTILES = ['error', 'valid_time', 'cost']
MEDIANS = ['energy_error', 'momentum_error', 'overlap', 'rate', 'true_rate', 'pressure',
           'true_pressure', 'noise', 'events']
MEANS = ['missed', 'extra', 'count_difference', 'valid_to_end']


def short(value):
    return '%.4g' % value


def numbers(rows, field):
    return [float(row[field]) for row in rows if row.get(field) not in (None, '')]


def quartiles(values):
    if len(values) < 2:
        return values * 3
    lower, _, upper = statistics.quantiles(values, n=4, method='inclusive')
    return [lower, statistics.median(values), upper]


def add_derived(row):
    simulated = float(row['simulated'] or 0)
    if simulated > 0 and float(row['cpu']) > 0:
        row['cost'] = float(row['cpu']) / simulated
    if row['impacts'] and row['true_impacts'] not in ('', '0'):
        row['count_difference'] = int(row['impacts']) / int(row['true_impacts']) - 1


def summarise(key, rows):
    good = [row for row in rows if not row['failure']]
    reasons = collections.Counter(row['failure'] for row in rows if row['failure'])
    out = dict(key, runs=len(rows), failed=len(rows) - len(good))
    out['failure'] = reasons.most_common(1)[0][0] if reasons else ''
    for field in QUARTILES:
        values = numbers(rows if field == 'cost' else good, field)
        for name, value in zip(['_q1', '', '_q3'], quartiles(values)):
            out[field + name] = short(value)
    for field, middle in [(f, statistics.median) for f in MEDIANS] + [
            (f, statistics.mean) for f in MEANS]:
        values = numbers(good, field)
        if values:
            out[field] = short(middle(values))
    return out


def main():
    runs_path, summary_path = sys.argv[1:3]
    groups = collections.OrderedDict()
    with open(runs_path, newline='') as file:
        for row in csv.DictReader(file):
            add_derived(row)
            key = tuple((f, row[f]) for f in ['part', 'scene', 'entrant', 'kind', 'k', 'balls'])
            groups.setdefault(key, []).append(row)
    fields = ['part', 'scene', 'entrant', 'kind', 'k', 'balls', 'step', 'runs', 'failed']
    fields += [f + q for f in QUARTILES for q in ['_q1', '', '_q3']] + MEDIANS + MEANS
    fields += ['failure']
    with open(summary_path, 'w', newline='') as file:
        writer = csv.DictWriter(file, fields, lineterminator='\n')
        writer.writeheader()
        for key, rows in groups.items():
            out = summarise(key, rows)
            out['step'] = short(float(rows[0]['step'] or 0))
            writer.writerow(out)


if __name__ == '__main__':
    main()
