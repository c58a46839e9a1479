# Two files "before" and "after" of "rank error" lines, largest error first, to
# an SVG of their tails: how many observations have an error above x.
# Usage: gnuplot -e "folder='...'" error_tails.gp
set terminal svg size 640,352 font 'sans-serif,13' background 'white'
before = folder . '/before'
after = folder . '/after'
stats before using 2 nooutput name 'BEFORE'
stats after using 2 nooutput name 'AFTER'
set border 3 linecolor '#999999'
set grid linecolor '#dddddd' linetype 1
set tics nomirror scale 0.3 textcolor '#333333'
set logscale y
set format y '%.0f'
set xrange [0:*]
set yrange [0.8:*]
set xlabel 'x: reprojection error, pixels' textcolor '#333333'
set label 'observations with an error above x' at graph 0,1.06 textcolor '#333333'
set tmargin 2.5
set key top right
plot before using 2:1 with lines linewidth 2 linecolor '#c0392b' \
       title sprintf('COLMAP: at most %.2f px', BEFORE_max), \
     after using 2:1 with lines linewidth 2 linecolor '#1f5fa8' \
       title sprintf('KROT: at most %.2f px', AFTER_max)
