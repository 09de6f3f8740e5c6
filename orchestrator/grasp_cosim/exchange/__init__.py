"""From the rows of every step to who listens: checked, extended, decimated.

What the sampled exchange of values creates, and what runs away, is found out here.
"""
