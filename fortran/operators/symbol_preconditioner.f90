!> The preconditioner of the inverse symbol on the nodes in contact, and that of the pressure.
!>
!> Displacements are continued beyond the edge of the contact (hc_edge_continuation) and multiplied by the inverse
!> symbol (inverse_symbol); the tractions beyond the edge are added to those inside by the transpose of the continuation.
!> The preconditioner of the shear traction (shear_preconditioner) extends it.
!>
!> Equations: docs/theory/preconditioner.md, (P1) to (P4), (P7).
module hc_symbol_preconditioner
  use, intrinsic :: iso_c_binding, only: c_f_pointer
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp, sp, lk
  use hc_error, only: error_t
  use hc_options, only: preconditioner_options_t
  use hc_lattice, only: lattice_t
  use hc_flexibility, only: transform_length
  use hc_field_space, only: field_space_t
  use hc_elastic_medium, only: elastic_medium_t
  use hc_spectrum_cache, only: kernel_cache_t
  use hc_active_set, only: active_set_t
  use hc_inverse_symbol, only: inverse_symbol_t, new_inverse_symbol
  use hc_preconditioner, only: preconditioner_t
  use hc_edge_continuation, only: edge_extension_t, new_edge_extension
  implicit none
  private

  public :: symbol_preconditioner_t, pressure_preconditioner_t, new_symbol_preconditioner

  !> Inverse symbol with its continuation beyond the contact.
  type, extends(preconditioner_t), abstract :: symbol_preconditioner_t
    type(inverse_symbol_t) :: inverse
    type(preconditioner_options_t) :: options
    !> Columns and rows of a field in the memory of this rank
    integer :: extent(2) = 0
    !> Columns and rows beside it on each side, where the surface is continued across slender cells, and those of all
    integer :: margin(2) = 0, wide(2) = 0
    !> On slender cells: rings of the continuation by the width of the contact
    real(wp) :: by_width = 0.0_wp
    !> Neighbours at the ends of short edges
    logical :: beside(6) = .true.
    !> Space of the fields
    type(field_space_t) :: space
    !> Numbers that are taken beside the displacements
    integer :: n_more = 0
    !> Continuation of displacements beyond the contact; none before there are active nodes
    type(edge_extension_t), allocatable :: edge
    !> Displacements, zero off the contact but for the rings of `edge`, then the tractions in their place, in memory that other
    !> transforms use between the applications
    real(sp), pointer, contiguous :: values(:) => null()
  contains
    !> Set up the continuation beyond the active nodes
    procedure :: continue_beyond
    !> Take memory for displacements and tractions
    procedure :: take_memory
  end type symbol_preconditioner_t

  !> Approximate inverse of the normal flexibility.
  type, extends(symbol_preconditioner_t) :: pressure_preconditioner_t
  contains
    procedure :: set_active => set_contact
    procedure :: apply_single => apply_to_pressure_single
    procedure :: apply_packed => apply_to_pressure_packed
    procedure :: clear => clear_contact
  end type pressure_preconditioner_t

contains

  !> Set up a preconditioner over a window.
  subroutine new_symbol_preconditioner(self, lattice, medium, space, options, error, cache, more)
    !> Preconditioner to be set up
    class(symbol_preconditioner_t), intent(out) :: self
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> The two bodies
    class(elastic_medium_t), intent(in) :: medium
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Tuning numbers
    type(preconditioner_options_t), intent(in) :: options
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error
    !> Cache of spectra
    type(kernel_cache_t), pointer, intent(in), optional :: cache
    !> For shear tractions: numbers of single precision that `take_memory` takes beside; absent: for the pressure
    integer, intent(in), optional :: more
    type(lattice_t) :: wider
    integer(int64) :: n

    self%beside = lattice%near_neighbors()
    self%by_width = options%rings_by_ratio*log(lattice%slenderness()/options%least_ratio)
    if (.not. present(more)) self%margin = margin_of(lattice, self%beside, options, space)
    wider = lattice
    wider%first = lattice%first - self%margin
    wider%extent = lattice%extent + 2*self%margin
    self%wide = space%own_extent(wider%extent)
    n = product(self%wide)
    if (present(more)) then
      n = 2*n + more
      self%n_more = more
    end if
    call new_inverse_symbol(self%inverse, wider, medium, space, error, present(more), cache, beside=n*(storage_size(1.0_sp)/8))
    ! work counts in applications of the operator over the window
    self%inverse%cost = self%inverse%cost*product(real(transform_length(wider), wp))/product(real(transform_length(lattice), wp))
    self%unit = self%inverse%unit
    self%extent = space%own_extent(lattice%extent)
    self%space = space
    self%options = options
  end subroutine new_symbol_preconditioner

  !> Return the columns and rows beside a window of slender cells: on a grid that fits the contact its images would be next to it.
  pure function margin_of(lattice, near, options, space) result(margin)
    type(lattice_t), intent(in) :: lattice
    !> Neighbours at the ends of short edges
    logical, intent(in) :: near(6)
    type(preconditioner_options_t), intent(in) :: options
    type(field_space_t), intent(in) :: space
    integer :: margin(2), across

    margin = 0
    ! several ranks share the rows
    if (lattice%is_periodic() .or. space%ranks%size > 1 .or. lattice%slenderness() < options%slender) return
    across = lattice%short_side()
    margin(across) = int(options%margins(merge(1, 2, all(near)))*lattice%extent(across))
  end function margin_of

  !> Set the nodes in contact, and their springs.
  subroutine set_contact(self, active, compliance, direction)
    class(pressure_preconditioner_t), intent(inout) :: self
    logical(lk), intent(in), contiguous :: active(:)
    real(wp), intent(in), optional, target, contiguous :: compliance(:), direction(:, :)

    if (any(self%margin > 0)) then
      call set_wide_contact(self, active, compliance)
    else if (present(compliance)) then
      call self%inverse%set_springs(self%options, compliance, active)
      ! displacements continue beyond the nodes on stiff springs
      call self%continue_beyond(self%extent, logical(active .and. .not. self%inverse%is_loose(compliance), lk))
    else
      call self%continue_beyond(self%extent, active)
    end if
  end subroutine set_contact

  !> Set the nodes in contact of a window with a margin, and their springs.
  subroutine set_wide_contact(self, active, compliance)
    class(pressure_preconditioner_t), intent(inout) :: self
    !> Active nodes of the window, and compliances of their springs
    logical(lk), intent(in) :: active(self%extent(1), self%extent(2))
    real(wp), intent(in), optional :: compliance(self%extent(1), self%extent(2))
    type(preconditioner_options_t) :: options
    logical(lk), allocatable :: wide(:, :)
    real(wp), allocatable :: springs(:, :)

    allocate (wide(self%wide(1), self%wide(2)), source=.false._lk)
    associate (from => self%margin + 1, to => self%margin + self%extent)
      wide(from(1):to(1), from(2):to(2)) = active
      if (present(compliance)) then
        allocate (springs(self%wide(1), self%wide(2)), source=0.0_wp)
        springs(from(1):to(1), from(2):to(2)) = compliance
        call self%inverse%set_springs(self%options, reshape(springs, [size(springs)]), reshape(wide, [size(wide)]))
        wide = wide .and. .not. self%inverse%is_loose(springs)
      end if
    end associate
    options = self%options
    options%patches = self%patches
    if (.not. allocated(self%edge)) allocate (self%edge)
    if (all(self%beside)) then
      call new_edge_extension(self%edge, wide, self%space, options)
    else
      call new_edge_extension(self%edge, wide, self%space, options, near=self%beside, by_width=self%by_width)
      call self%edge%set_floor(wide, maxloc(self%margin, dim=1), options%floor)
    end if
  end subroutine set_wide_contact

  !> Set up the continuation beyond some nodes, which are handed on without a copy.
  subroutine continue_beyond(self, extent, active)
    class(symbol_preconditioner_t), intent(inout) :: self
    !> Columns and rows of the window
    integer, intent(in) :: extent(2)
    !> The nodes
    logical(lk), intent(in) :: active(extent(1), extent(2))
    type(preconditioner_options_t) :: options

    options = self%options
    options%patches = self%patches
    if (.not. allocated(self%edge)) allocate (self%edge)
    call new_edge_extension(self%edge, active, self%space, options, near=self%beside)
  end subroutine continue_beyond

  !> Take memory for displacements, zero, and other fields beside them.
  subroutine take_memory(self, n, more)
    class(symbol_preconditioner_t), intent(inout) :: self
    !> Number of values
    integer, intent(in) :: n
    !> Further numbers, zero
    real(sp), pointer, contiguous, intent(out), optional :: more(:)
    real(sp), pointer, contiguous :: all(:)
    integer :: n_all, i

    n_all = n
    if (present(more)) n_all = n + self%n_more
    call c_f_pointer(self%inverse%beside(), all, [n_all])
    !$omp parallel do simd schedule(static) num_threads(self%space%threads)
    do i = 1, n_all
      all(i) = 0.0_sp
    end do
    !$omp end parallel do simd
    self%values => all(:n)
    if (present(more)) more => all(n + 1:)
  end subroutine take_memory

  !> Estimate the pressure at the nodes in contact that causes a closing of the gap.
  subroutine apply_to_pressure_packed(self, nodes, n, displacement, traction, work)
    class(pressure_preconditioner_t), intent(inout) :: self
    type(active_set_t), intent(in) :: nodes
    integer, intent(in) :: n
    real(wp), intent(in), contiguous :: displacement(:)
    real(wp), intent(inout), contiguous :: traction(:)
    real(wp), intent(inout) :: work
    integer :: i, k, shift

    call self%take_memory(n)
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, shift)
    do k = 1, size(nodes%first)
      shift = nodes%place(k) - nodes%first(k)
      do i = nodes%first(k), nodes%last(k)
        self%values(i) = real(displacement(i + shift)/self%unit, sp)
      end do
    end do
    !$omp end parallel do
    if (any(self%margin > 0)) then
      call apply_wide(self, self%values)
    else
      call self%inverse%apply_in_place(self%values, self%edge)
    end if
    work = work + self%inverse%cost
    !$omp parallel do schedule(static) num_threads(self%space%threads) private(i, shift)
    do k = 1, size(nodes%first)
      shift = nodes%place(k) - nodes%first(k)
      do i = nodes%first(k), nodes%last(k)
        traction(i + shift) = self%values(i)
      end do
    end do
    !$omp end parallel do
  end subroutine apply_to_pressure_packed

  !> Estimate it in single precision.
  subroutine apply_to_pressure_single(self, displacement, traction, work)
    class(pressure_preconditioner_t), intent(inout) :: self
    real(sp), intent(inout), contiguous, target :: displacement(:)
    real(sp), intent(out), contiguous, target :: traction(:)
    real(wp), intent(inout) :: work
    integer :: i

    !$omp parallel do simd schedule(static) num_threads(self%space%threads)
    do i = 1, size(traction)
      traction(i) = displacement(i)
    end do
    !$omp end parallel do simd
    if (any(self%margin > 0)) then
      call apply_wide(self, traction)
    else
      call self%inverse%apply_in_place(traction, self%edge)
    end if
    work = work + self%inverse%cost
  end subroutine apply_to_pressure_single

  !> Turn displacements of a window with a margin into tractions.
  subroutine apply_wide(self, field)
    class(pressure_preconditioner_t), intent(inout) :: self
    real(sp), intent(inout) :: field(self%extent(1), self%extent(2))
    real(sp), allocatable :: wide(:, :)

    allocate (wide(self%wide(1), self%wide(2)), source=0.0_sp)
    associate (from => self%margin + 1, to => self%margin + self%extent)
      wide(from(1):to(1), from(2):to(2)) = field
      call self%inverse%apply_in_place(wide, self%edge)
      field = wide(from(1):to(1), from(2):to(2))
    end associate
  end subroutine apply_wide

  !> Discard the nodes in contact.
  subroutine clear_contact(self)
    class(pressure_preconditioner_t), intent(inout) :: self

    if (allocated(self%edge)) deallocate (self%edge)
  end subroutine clear_contact

end module hc_symbol_preconditioner
