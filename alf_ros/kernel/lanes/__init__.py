"""Steps of several members of an ensemble at once, a member in each lane of a register.

The functions of a stage are the functions of a single mechanism, compiled for lanes. The functions
of this folder decide for a group: when a solve of one lane is finished while other solves
continue, and which lanes leave the group for some steps. A lane leaves where the step of a single
mechanism does more than an ordinary one: beside a singular position, where an iteration begins
again, where a rank may be lost. Then the kernel of a single mechanism takes these steps, and the
others wait.
"""
