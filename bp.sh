. /tmp/s/env.sh; export PRE=1 XP=1
for p in bp1 bp2 bp3; do rm -rf /tmp/C/$p; python /tmp/s/chain.py $p /tmp/C/$p views metrics; done
