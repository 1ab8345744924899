"""The fault campaign: every class of fault, at random moments, with the promises checked on every sample.

classes.py    the table of faults: what is done, to which process, what must notice it, and how soon
seen.py       what is seen of a run from outside: commands, statuses, the true motion
promises.py   the promises of the design, checked on what was seen (pure)
measure.py    what each stop was like: detector, times, distance (pure)
timeline.py   the samples of it that a picture is drawn from (pure)
trial.py      the record of one trial, and its line of JSON

The virtual campaign runs the same services on a virtual clock (docs/decisions/0017):

scenario.py      what happens in a trial, drawn from its seed (pure)
operator.py      a person at the keyboard's place
machine.py       what outlives their supervisor
writers.py       what a second lidar says (pure)
world.py         the processes on their virtual network, each of which can die, hang and start again
surroundings.py  how near the hull is to anything, and how much of that is its own doing
injector.py      does to the world what the scenario says
demands.py       what must follow from it, and when (pure)
virtual.py       one seed, from its scenario to its trial
campaign.py      many seeds on several cores: progress, file, exit code
table.py         what trials come to

The real campaign breaks real processes over real Zenoh, with the operator's keys typed into teleop's terminal:

real.py        one trial: drive, break, watch, recover, judge
rounds.py      many trials: order, file, resume, exit code
stage.py       supervisord, supervisor, sim, teleop, observer, links: up, down, and in order again
injectors/     how each fault is done
armed.py       runs one of our processes with faults in it, which a signal sets off
proxy.py, links.py    TCP links that can be cut, delayed, healed: the process, and the campaign's end of it
namespaces.py  a network namespace and a cable, where root allows them
attacker.py, attacks.py    a client that keeps no rules: the process, and what it says (pure)
observer.py    what is seen of a trial: a client of the wire of its own, and the wheels
wheels.py      what the base does, told past the network
times.py       from the fault to a zero that lasts (pure)
summary.py, progress.py    the table; how far it is
report.py      `lifeline fault-report`: page.py the page, figures.py its numbers, statistics.py and drawing.py what they need
origin.py      where and when a campaign ran
janitor.py     cleans up after a campaign that was killed
child.py       a helper process that takes orders
"""
