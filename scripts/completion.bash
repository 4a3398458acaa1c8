# Completion of stickslip for bash: commands, scenes, and the options and values that `stickslip COMMAND -help` lists.
# Methods (rk:5dp) hold a colon, at which bash parts words; names of options stand in lists with commas between.
_stickslip() {
  local word=${COMP_WORDS[COMP_CWORD]} at=$COMP_CWORD command=${COMP_WORDS[1]} program=${COMP_WORDS[0]}
  local IFS=$'\n' values= head= before
  if [[ $word == : ]]; then head=${COMP_WORDS[at - 1]}: word= at=$((at - 1))
  elif ((at > 2)) && [[ ${COMP_WORDS[at - 1]} == : ]]; then head=${COMP_WORDS[at - 2]}: at=$((at - 2)); fi
  before=${COMP_WORDS[at - 1]}
  if ((COMP_CWORD == 1)); then
    values=$("$program" --help | sed -n '/^commands:/,/^$/s/^  \([a-z]*\) .*/\1/p')
  elif [[ $word == -* ]]; then
    values=$("$program" "$command" -help 2>/dev/null | sed -n 's/^  \(-[a-z]\w*\) .*/\1/p')
  elif [[ $before =~ ^-(boundary_parameter|sweep_parameter|cycle_continue|wave_continue|fit_parameters|boundary_same) ]]; then
    [[ $word == *,* ]] && head=${word%,*}, word=${word##*,}
    [[ $command == sweep ]] && command=run
    values=$("$program" "$command" -help 2>/dev/null | sed -n 's/^  -\([a-z]\w*\) \[.*\]: a finite number.*/\1/p')
    COMPREPLY=($(compgen -P "$head" -W "$values" -- "$word"))
    return
  elif [[ $before == -* ]]; then
    values=$("$program" "$command" -help 2>/dev/null | sed -n "s/^  $before \[.*\]: one of \(.*\)/\1/p" | sed 's/, */\n/g')
  fi
  if [ -n "$values" ]; then COMPREPLY=($(compgen -W "$values" -- "$head$word")) && COMPREPLY=("${COMPREPLY[@]#"$head"}")
  else COMPREPLY=($(compgen -f -- "$word")); fi
}
complete -o filenames -F _stickslip stickslip
