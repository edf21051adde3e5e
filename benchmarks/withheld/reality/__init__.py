"""A laboratory whose physics is known: it writes measurement campaigns and seals their causes.

::

    palette_file  what the palette publishes        design    which specimens are made
    base_law      what the grades really do         profiles  what is printed along a graded bar
    effects/      one unmodelled effect a file      protocol  how the crosshead moves
    bench         one group of specimens, mounted   noise     what differs between equal specimens
    solver        force and strains in time         sensors   what the machine writes down
    strength      how visible an effect is          tiers     which truths a set holds
    campaign      all of it, once                   sealing   the folder and the sealed truth

Nothing here is imported by planner, and nothing of planner is imported here: a diagnosis that is
checked on its own formulas proves nothing.
"""
